// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/cao_reader.h"
#include "mbt/trunk_settings.h"

#include <gmock/gmock.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <unistd.h>

namespace
{
using namespace bole;
using testing::HasSubstr;
namespace fs = std::filesystem;

class TrunkSettingsFile : public testing::Test
{
protected:
  ~TrunkSettingsFile() override { fs::remove(m_path); }
  TrunkSettings read(const std::string &text) const
  {
    std::ofstream(m_path) << text;
    return readTrunkSettings(m_path, vpMbTrunkTracker::Options());
  }
  std::string messageOf(const std::string &text) const
  {
    try {
      read(text);
    }
    catch (const vpException &error) {
      return error.what();
    }
    return "";
  }
  const std::string m_path = testing::TempDir() + "trunk_settings_" + std::to_string(::getpid()) + ".xml";
};

TEST_F(TrunkSettingsFile, ViSPsOwnSettingsAreRead)
{
  const fs::path path = fs::path(BOLE_VISP_IMAGES_DIR) / "mbt/cube.xml";
  if (!fs::exists(path))
    GTEST_SKIP() << path << " is absent: package visp-images-data";
  const TrunkSettings settings = readTrunkSettings(path.string(), vpMbTrunkTracker::Options());
  EXPECT_TRUE(settings.has_camera);
  EXPECT_DOUBLE_EQ(settings.camera.get_px(), 547.7367575);
  EXPECT_DOUBLE_EQ(settings.far_clipping.value(), 0.9);
  EXPECT_NEAR(settings.angle_appear.value(), 65 * M_PI / 180, 1e-12);
  EXPECT_TRUE(settings.fov_clipping);
}

TEST_F(TrunkSettingsFile, TheSectionOfTrunksIsRead)
{
  const TrunkSettings settings = read("<conf>\n<!-- a comment --><trunk><scan_max_px>16</scan_max_px>\n<radius_sigma> "
                                      "0.05 </radius_sigma></trunk></conf>");
  EXPECT_EQ(settings.options.scan_max_px, 16);
  EXPECT_EQ(settings.options.radius_sigma, 0.05);
  EXPECT_FALSE(settings.has_camera);
}

TEST_F(TrunkSettingsFile, WhatDoesNotFitIsRefusedWithItsLine)
{
  EXPECT_THAT(messageOf("<conf>\n<trunk>\n<pieces>6</pieces></trunk></conf>"),
              HasSubstr(":3: trunk/pieces: no such key"));
  EXPECT_THAT(messageOf("<conf>\n<trunk><lever_m>600</lever_m></trunk></conf>"),
              HasSubstr(":2: lever_m = 600, must be in [0.1, 100]"));
  EXPECT_THAT(messageOf("<conf><trunk>\n<min_support>much</min_support></trunk></conf>"),
              HasSubstr(":2: min_support = much, must be a number"));
  EXPECT_THAT(messageOf("<conf><trunk><lever_m>4</lever_m><lever_m>5</lever_m></trunk></conf>"),
              HasSubstr("trunk/lever_m: given twice"));
  EXPECT_THAT(messageOf("<conf><camera><u0>1</u0></camera></conf>"), HasSubstr("camera: must hold u0, v0, px and py"));
  EXPECT_THAT(messageOf("<conf><trunk></conf>"), HasSubstr("</conf> closes what is not open"));
  EXPECT_THAT(messageOf("<conf><trunk>"), HasSubstr("<trunk> is never closed"));
  EXPECT_THROW(readTrunkSettings("/nowhere.xml", {}), vpException);
}

TEST_F(TrunkSettingsFile, TheFilesInModelsAreReadAndTrunksXmlHoldsTheDefaults)
{
  const fs::path models = fs::path(BOLE_SOURCE_DIR) / "models";
  int models_read = 0;
  for (const auto &entry : fs::directory_iterator(models)) {
    if (entry.path().extension() == ".cao") {
      EXPECT_FALSE(readCao(entry.path().string()).empty()) << entry.path();
      ++models_read;
    }
    if (entry.path().extension() == ".xml") {
      EXPECT_TRUE(readTrunkSettings(entry.path().string(), {}).has_camera) << entry.path();
      ++models_read;
    }
  }
  EXPECT_GE(models_read, 4);
  vpMbTrunkTracker::Options changed; // the file sets everything that was changed back to its default
  const vpMbTrunkTracker::Options defaults;
  constexpr auto kCount = sizeof(changed) / sizeof(double);
  static_assert(sizeof(changed) == kCount * sizeof(double), "options are numbers");
  double before[kCount], after[kCount], wanted[kCount];
  for (double &value : before)
    value = 8;
  before[kCount - 1] = 0; // detect_frozen
  std::memcpy(&changed, before, sizeof(changed));
  changed.lean_sigma_rad = 0.4, changed.radius_sigma = 0.9, changed.turn_sigma_rad = 0.9, changed.min_support = 0.9;
  changed.max_sigma_rad = 0.9;
  ASSERT_NO_THROW(changed.validate());
  const auto read = readTrunkSettings((models / "trunks.xml").string(), changed).options;
  std::memcpy(after, &read, sizeof(read));
  std::memcpy(wanted, &defaults, sizeof(defaults));
  for (std::size_t k = 0; k < kCount; ++k)
    EXPECT_EQ(after[k], wanted[k]) << "option " << k;
}
} // namespace
