// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/open_source.h>
#include <bole/config.h>

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using testing::HasSubstr;

std::string messageOf(const std::string &yaml)
{
  const std::string path = testing::TempDir() + "config_test.yaml";
  std::ofstream(path) << yaml;
  StageOptions options;
  try {
    readConfig(path, options);
  }
  catch (const vpException &error) {
    return error.getStringMessage();
  }
  return "";
}

TEST(Config, DefaultPresetIsWhatTheCodeHas)
{
  std::ifstream file(BOLE_SOURCE_DIR "/config/default.yaml");
  std::stringstream text;
  for (std::string line; std::getline(file, line);)
    if (line.empty() || line[0] != '#')
      text << line << "\n";
  EXPECT_EQ(text.str(), toYaml(StageOptions()));
}

TEST(Config, PaperPresetIsRead)
{
  StageOptions options;
  readConfig(BOLE_SOURCE_DIR "/config/paper.yaml", options);
  EXPECT_EQ(options.tracking.energy.form, EnergyForm::paper);
  EXPECT_FALSE(options.flow.use_points);
}

/// Every file of config/ is a preset, and the cameras of the drones stand beside theirs.
TEST(Config, EveryPresetIsReadAndChangesWhatItNames)
{
  const std::string defaults = toYaml(StageOptions());
  std::vector<std::string> names;
  for (const auto &entry : std::filesystem::directory_iterator(BOLE_SOURCE_DIR "/config")) {
    if (!entry.is_regular_file())
      continue;
    StageOptions options;
    EXPECT_NO_THROW(readConfig(entry.path().string(), options)) << entry.path();
    names.push_back(entry.path().stem().string());
    EXPECT_EQ(toYaml(options) == defaults, names.back() == "default") << names.back();
  }
  EXPECT_THAT(names, testing::IsSupersetOf({"default", "paper", "ardrone1", "ardrone2", "tabletop"}));
  EXPECT_EQ(readCamera(BOLE_SOURCE_DIR "/config/cameras/ardrone1.yaml").model.pinhole.width, 320);
  EXPECT_EQ(readCamera(BOLE_SOURCE_DIR "/config/cameras/ardrone2.yaml").model.pinhole.width, 640);
}

TEST(Config, CompressedPresetIsWhatTheCodeHas)
{
  StageOptions options;
  readConfig(BOLE_SOURCE_DIR "/config/compressed.yaml", options);
  EXPECT_EQ(toYaml(options), toYaml(forCompressedVideo()));
  EXPECT_NE(toYaml(options), toYaml(StageOptions()));
}

TEST(Config, ReadingWhatWasWrittenChangesNothing)
{
  StageOptions options;
  setOption("detection.window=31", options);
  setOption("points.frames_back=[1, 2, 5]", options);
  const std::string path = testing::TempDir() + "config_round.yaml";
  std::ofstream(path) << toYaml(options);
  StageOptions read;
  readConfig(path, read);
  EXPECT_EQ(toYaml(read), toYaml(options));
  EXPECT_EQ(read.detection.window, 31);
}

TEST(Config, MistakesAreNamedWithTheirLine)
{
  EXPECT_THAT(messageOf("detection:\n  widow: 3\n"), HasSubstr("config_test.yaml:2: detection.widow is no option"));
  EXPECT_THAT(messageOf("dection:\n  window: 3\n"), HasSubstr(":1: dection is no stage"));
  EXPECT_THAT(messageOf("map:\n  radius_min: thin\n"), HasSubstr(":2: map.radius_min = thin, must be a number"));
  EXPECT_THAT(messageOf("detection:\n  window: 10.7\n"), HasSubstr("must be a whole number"));
  EXPECT_THAT(messageOf("detection:\n  window: 10\n  window: 11\n"), HasSubstr("twice"));
  EXPECT_THAT(messageOf("flow:\n  use_points: true\n  gate: 1e9\n"), HasSubstr(":3: flow.gate = 1e+09, must be in"));
}

TEST(Config, AMistakeLeavesTheOptionsAsTheyWere)
{
  StageOptions options;
  const std::string before = toYaml(options);
  EXPECT_THROW(setOption("detection.window=1000", options), vpException);
  EXPECT_THROW(setOption("detection.nothing=1", options), vpException);
  EXPECT_EQ(toYaml(options), before);
}
} // namespace
