// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/option_table.h"
#include <bole/config.h>
#include <bole/open_source.h>

#include <gmock/gmock.h>

#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <sstream>
#include <string>
#include <unistd.h>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using testing::AllOf;
using testing::HasSubstr;

std::string written(const std::string &yaml)
{
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "_config_test.yaml";
  std::ofstream(path) << yaml;
  return path;
}

/// What is said of a file of \p yaml; "" where it is taken.
std::string messageOf(const std::string &yaml)
{
  Options options;
  try {
    readConfig(written(yaml), options);
  }
  catch (const vpException &error) {
    EXPECT_EQ(toYaml(options), toYaml(Options())) << "an error must leave the options as they were";
    return error.getStringMessage();
  }
  return "";
}

/// What is said of --set \p assignments.
std::string messageOfSet(const std::vector<std::string> &assignments)
{
  Options options;
  try {
    setOptions(assignments, options);
  }
  catch (const vpException &error) {
    EXPECT_EQ(toYaml(options), toYaml(Options()));
    return error.getStringMessage();
  }
  return "";
}

std::string textOf(const std::string &path)
{
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Config, DefaultPresetIsWhatTheCodeHas)
{
  EXPECT_THAT(textOf(BOLE_SOURCE_DIR "/config/default.yaml"), testing::EndsWith(toYaml(Options())));
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
  Options read;
  readConfig(written(toYaml(options)), read);
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
} // namespace
