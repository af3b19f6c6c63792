// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "pipeline/option_table.h"
#include "pipeline/stage_options.h"
#include <bole/config.h>
#include <bole/open_source.h>

namespace
{
using namespace bole;
using testing::AllOf;
using testing::HasSubstr;

/// What is said of a file of \p yaml; "" where it is taken.
std::string messageOf(const std::string &yaml)
{
  const test::TemporaryFolder folder;
  Options options;
  const std::string message = test::messageOf([&] { readConfig(folder.write("config_test.yaml", yaml), options); });
  EXPECT_TRUE(message.empty() || toYaml(options) == toYaml(Options()))
      << "an error must leave the options as they were";
  return message;
}

/// What is said of --set \p assignments.
std::string messageOfSet(const std::vector<std::string> &assignments)
{
  Options options;
  const std::string message = test::messageOf([&] { setOptions(assignments, options); });
  EXPECT_TRUE(message.empty() || toYaml(options) == toYaml(Options()));
  return message;
}

TEST(Config, DefaultPresetIsWhatTheCodeHas)
{
  EXPECT_THAT(test::textOf(BOLE_SOURCE_DIR "/config/default.yaml"), testing::EndsWith(toYaml(Options())));
}

TEST(Config, HasNoMoreThanFortyOptionsAndSaysOfEachWhatItDoes)
{
  const std::vector<OptionDescription> all = describeOptions();
  EXPECT_LE(all.size(), 40u);
  for (const OptionDescription &option : all) {
    EXPECT_FALSE(option.effect.empty()) << option.key;
    EXPECT_FALSE(option.range.empty()) << option.key;
  }
}

/// Every file of config/ is a preset, and the cameras of the drones stand beside theirs.
TEST(Config, EveryPresetIsReadAndChangesWhatItNames)
{
  const std::string defaults = toYaml(Options());
  std::vector<std::string> names;
  for (const auto &entry : std::filesystem::directory_iterator(BOLE_SOURCE_DIR "/config")) {
    if (!entry.is_regular_file())
      continue;
    Options options;
    EXPECT_NO_THROW(readConfig(entry.path().string(), options)) << entry.path();
    names.push_back(entry.path().stem().string());
    EXPECT_EQ(toYaml(options) == defaults, names.back() == "default") << names.back();
  }
  EXPECT_THAT(names, testing::UnorderedElementsAre("default", "ardrone1", "ardrone2", "tabletop"));
  EXPECT_EQ(readCamera(BOLE_SOURCE_DIR "/config/cameras/ardrone1.yaml").model.pinhole.width, 320);
  EXPECT_EQ(readCamera(BOLE_SOURCE_DIR "/config/cameras/ardrone2.yaml").model.pinhole.width, 640);
}

TEST(Config, ReadingWhatWasWrittenChangesNothing)
{
  Options options;
  for (OptionEntry &entry : optionTable(options)) // another value in each than its default
    if (auto *const *flag = std::get_if<bool *>(&entry.value))
      **flag = !**flag;
    else
      EXPECT_TRUE(entry.assign(std::get_if<int *>(&entry.value) ? "31" : fmt::format("{}", entry.high.value)))
          << entry.key;
  const test::TemporaryFolder folder;
  Options read;
  readConfig(folder.write("all.yaml", toYaml(options)), read);
  EXPECT_EQ(toYaml(read), toYaml(options));
  EXPECT_EQ(read.detection.window, 31);
  EXPECT_FALSE(read.stages.points);
}

/// Each option with each mistake, in the third line of a file and on the command line.
TEST(Config, EveryMistakeInEveryOptionIsNamedWithItsLine)
{
  Options options;
  for (const OptionEntry &entry : optionTable(options)) {
    std::vector<std::string> wrong = {"thin", "[1, 2]", "nan", ".inf", "1e999", "0,5", "", "{a: 1}", "1 2"};
    if (entry.isNumber()) {
      wrong.push_back(fmt::format("{}", std::floor(entry.low.value - 1)));
      wrong.push_back(fmt::format("{}", std::ceil(entry.high.value + 1)));
    }
    else
      wrong.push_back("1");
    if (std::holds_alternative<int *>(entry.value))
      wrong.insert(wrong.end(), {"10.7", "99999999999"});
    const std::string line = fmt::format("# a comment\n{}:\n  {}: ", entry.section(), entry.name());
    for (const std::string &value : wrong) {
      EXPECT_THAT(messageOf(line + value + "\n"),
                  AllOf(HasSubstr(std::string("config_test.yaml:3: ") + entry.key + " = "),
                        HasSubstr("must be " + entry.allowed())))
          << value;
      EXPECT_THAT(messageOfSet({std::string(entry.key) + "=" + value}),
                  AllOf(HasSubstr(std::string("--set ") + entry.key + "=" + value + ": " + entry.key + " = "),
                        HasSubstr("must be " + entry.allowed())));
    }
    const std::string good = entry.text();
    EXPECT_EQ(messageOf(line + good + "\n"), "");
    EXPECT_THAT(messageOf(line + good + "\n  " + entry.name() + ": " + good + "\n"),
                HasSubstr(std::string("config_test.yaml:4: ") + entry.key + " is given twice"));
    EXPECT_THAT(messageOfSet({std::string(entry.key) + "=" + good, std::string(entry.key) + "=" + good}),
                HasSubstr(std::string(entry.key) + " is given twice"));
    EXPECT_THAT(messageOf(fmt::format("{}:\n  {}x: 1\n", entry.section(), entry.name())),
                HasSubstr(fmt::format(":2: {0}x is no option; did you mean {0}?", entry.key)));
  }
}

TEST(Config, NamesTheKeyThatWasMeant)
{
  EXPECT_THAT(messageOf("detection:\n  widow: 3\n"),
              HasSubstr("config_test.yaml:2: detection.widow is no option; did you mean detection.window?"));
  EXPECT_THAT(messageOf("dection:\n  window: 3\n"), HasSubstr(":1: dection is no section; did you mean detection?"));
  EXPECT_THAT(messageOf("map:\n  window: 3\n"), HasSubstr("map.window is no option; did you mean detection.window?"));
  EXPECT_THAT(messageOf("map:\n  quite_something_else: 3\n"), HasSubstr("is no option; bole options lists them"));
  EXPECT_THAT(messageOfSet({"window=3"}), HasSubstr("window is no option; did you mean detection.window?"));
  EXPECT_THAT(messageOfSet({"detection.window"}), HasSubstr("must be section.name=value"));
}

TEST(Config, RangesThatDependOnAnotherOptionAreThoseWhenAllIsSet)
{
  EXPECT_EQ(messageOf("trunks:\n  radius_min: 0.7\n  radius_max: 0.9\n"), "");
  EXPECT_EQ(messageOfSet({"trunks.radius_min=0.7", "trunks.radius_max=0.9"}), "");
  EXPECT_THAT(messageOf("trunks:\n  radius_min: 0.7\n"),
              HasSubstr(":2: trunks.radius_min = 0.7, must be a number in [0.005, trunks.radius_max = 0.6]"));
}

TEST(Config, AFileThatIsNoMapOfSectionsIsRefusedWithItsLine)
{
  EXPECT_THAT(messageOf("- 1\n"), HasSubstr("config_test.yaml:1: must be a map of sections"));
  EXPECT_THAT(messageOf("map: 3\n"), HasSubstr(":1: map = 3, must be a map of options"));
  EXPECT_THAT(messageOf("map:\n"), HasSubstr(":1: map = (nothing), must be a map of options"));
  EXPECT_EQ(messageOf("# nothing but a comment\n"), "");
}

PinholeCamera cameraWith(double f)
{
  PinholeCamera camera;
  camera.fx = camera.fy = f;
  return camera;
}

/// What the saliency is told.
std::vector<double> valuesOf(const SaliencyOptions &o)
{
  return {o.sigma_background_px,  o.sigma_foreground_px, double(o.levels),
          double(o.finest_level), o.near_range,          o.min_range};
}

TEST(StageOptions, OfTheDefaultsAreTheStagesDefaultsForACameraOf200Px)
{
  const StageOptions made = stageOptions(Options(), cameraWith(200)), defaults;
  EXPECT_EQ(made.gradient.sigma_px, defaults.gradient.sigma_px);
  EXPECT_EQ(made.detection.inlier_px, defaults.detection.inlier_px);
  EXPECT_EQ(made.tracking.scan_max_px, defaults.tracking.scan_max_px);
  EXPECT_EQ(made.flow.view_spacing, defaults.flow.view_spacing);
  EXPECT_EQ(made.points.frames_back, defaults.points.frames_back);
  EXPECT_FALSE(made.smoothing.forgets);
  EXPECT_EQ(made.smoothing.window, 40);
  EXPECT_NEAR(made.map.confirm_odds, defaults.map.confirm_odds, 1e-3);
  EXPECT_EQ(valuesOf(made.saliency), valuesOf(defaults.saliency));
}

/// What `bole options` allows, the stages take: at both ends of every range, for every camera.
TEST(StageOptions, TakeEveryValueThatARangeAllows)
{
  for (const double f : {20.0, 200.0, 570.0, 5000.0})
    for (const bool is_high : {false, true}) {
      Options names;
      for (std::size_t i = 0; i < optionTable(names).size(); ++i) {
        Options options;
        OptionEntry entry = optionTable(options)[i];
        if (std::holds_alternative<bool *>(entry.value))
          **std::get_if<bool *>(&entry.value) ^= true;
        else
          ASSERT_TRUE(entry.assign(fmt::format("{}", is_high ? entry.high.value : entry.low.value)));
        const StageOptions made = stageOptions(options, cameraWith(f));
        EXPECT_NO_THROW(Smoother(made.smoothing)) << entry.key << " = " << entry.text() << ", f = " << f;
      }
    }
}

TEST(StageOptions, ThresholdsOnThePictureFollowTheFocalLength)
{
  const StageOptions narrow = stageOptions(Options(), cameraWith(600)),
                     usual = stageOptions(Options(), cameraWith(200));
  EXPECT_DOUBLE_EQ(narrow.lines.width_min_px, 3 * usual.lines.width_min_px);
  EXPECT_DOUBLE_EQ(narrow.tracking.scan_max_px, 2 * usual.tracking.scan_max_px);
  EXPECT_EQ(narrow.saliency.finest_level, usual.saliency.finest_level + 1); // which makes half of the three
  EXPECT_EQ(narrow.saliency.window_width_px, 5);
  EXPECT_EQ(narrow.saliency.window_height_px % 2, 1);
}

TEST(StageOptions, WhatIsCountedInFramesFollowsTheRate)
{
  Options options;
  options.camera.rate = 30;
  options.map.lag = 30;
  const StageOptions fast = stageOptions(options, cameraWith(200));
  EXPECT_THAT(fast.points.frames_back, testing::ElementsAre(3, 9));
  EXPECT_EQ(fast.points.every, 3);
  EXPECT_EQ(fast.smoothing.window, 900);
  EXPECT_TRUE(fast.smoothing.forgets);
  EXPECT_EQ(fast.saliency.max_frames_apart, 15);
  options.camera.rate = 15;
  EXPECT_THAT(stageOptions(options, cameraWith(200)).points.frames_back, testing::ElementsAre(1, 4));
  options.camera.rate = 5;
  EXPECT_THAT(stageOptions(options, cameraWith(200)).points.frames_back, testing::ElementsAre(1, 2));
}
} // namespace
