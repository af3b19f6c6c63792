// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/cao_reader.h"
#include "mbt/trunk_settings.h"

#include <gmock/gmock.h>

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
  const TrunkSettings settings =
      read("<conf>\n<!-- a comment --><trunk><pieces>6</pieces>\n<radius_sigma> 0.05 </radius_sigma></trunk></conf>");
  EXPECT_EQ(settings.options.trunk.pieces, 6);
  EXPECT_EQ(settings.options.radius_sigma, 0.05);
  EXPECT_FALSE(settings.has_camera);
}

TEST_F(TrunkSettingsFile, WhatDoesNotFitIsRefusedWithItsLine)
{
  EXPECT_THAT(messageOf("<conf>\n<trunk>\n<piece>6</piece></trunk></conf>"), HasSubstr(":3: trunk/piece: no such key"));
  EXPECT_THAT(messageOf("<conf>\n<trunk><pieces>60</pieces></trunk></conf>"),
              HasSubstr(":2: pieces = 60, must be 1 .. 16"));
  EXPECT_THAT(messageOf("<conf><trunk>\n<min_support>much</min_support></trunk></conf>"),
              HasSubstr(":2: min_support = much, must be a number"));
  EXPECT_THAT(messageOf("<conf><trunk><pieces>4</pieces><pieces>5</pieces></trunk></conf>"),
              HasSubstr("trunk/pieces: given twice"));
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
  vpMbTrunkTracker::Options changed, defaults; // the file sets everything that was changed back to its default
  changed.trunk.pieces = 9, changed.trunk.samples = 99, changed.trunk.min_length_px = 99,
  changed.trunk.min_width_px = 9;
  changed.trunk.min_contrast = 9, changed.border_sigma_px = 9, changed.lean_sigma_rad = 0.4, changed.radius_sigma = 0.9;
  changed.scan_min_px = 9, changed.scan_max_px = 99, changed.refine_px = 9, changed.refinements = 4,
  changed.step_sigma_m = 9, changed.climb_sigma_m = 9;
  changed.turn_sigma_rad = 0.9, changed.accel_sigma_m = 0.1, changed.min_support = 0.9, changed.min_agreement = 0.9,
  changed.max_jump = 9, changed.max_sigma_m = 9, changed.max_sigma_rad = 0.9, changed.unobserved_m = 9,
  changed.lever_m = 9;
  changed.health.detect_frozen = false;
  const auto o = readTrunkSettings((models / "trunks.xml").string(), changed).options;
  EXPECT_EQ(o.trunk.pieces, defaults.trunk.pieces);
  EXPECT_EQ(o.trunk.samples, defaults.trunk.samples);
  EXPECT_EQ(o.trunk.min_length_px, defaults.trunk.min_length_px);
  EXPECT_EQ(o.trunk.min_width_px, defaults.trunk.min_width_px);
  EXPECT_EQ(o.trunk.min_contrast, defaults.trunk.min_contrast);
  EXPECT_EQ(o.border_sigma_px, defaults.border_sigma_px);
  EXPECT_EQ(o.lean_sigma_rad, defaults.lean_sigma_rad);
  EXPECT_EQ(o.radius_sigma, defaults.radius_sigma);
  EXPECT_EQ(o.scan_min_px, defaults.scan_min_px);
  EXPECT_EQ(o.scan_max_px, defaults.scan_max_px);
  EXPECT_EQ(o.refine_px, defaults.refine_px);
  EXPECT_EQ(o.refinements, defaults.refinements);
  EXPECT_EQ(o.step_sigma_m, defaults.step_sigma_m);
  EXPECT_EQ(o.turn_sigma_rad, defaults.turn_sigma_rad);
  EXPECT_EQ(o.climb_sigma_m, defaults.climb_sigma_m);
  EXPECT_EQ(o.accel_sigma_m, defaults.accel_sigma_m);
  EXPECT_EQ(o.min_support, defaults.min_support);
  EXPECT_EQ(o.min_agreement, defaults.min_agreement);
  EXPECT_EQ(o.max_jump, defaults.max_jump);
  EXPECT_EQ(o.max_sigma_m, defaults.max_sigma_m);
  EXPECT_EQ(o.max_sigma_rad, defaults.max_sigma_rad);
  EXPECT_EQ(o.unobserved_m, defaults.unobserved_m);
  EXPECT_EQ(o.lever_m, defaults.lever_m);
  EXPECT_EQ(o.health.detect_frozen, defaults.health.detect_frozen);
}
} // namespace
