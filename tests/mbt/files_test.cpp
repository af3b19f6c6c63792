// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "mbt/model_files.h"
#include <bole/vpMbTrunkTracker.h>
#include <cstring>
#include <visp3/mbt/vpMbGenericTracker.h>

namespace
{
using namespace bole;
using testing::HasSubstr;
namespace fs = std::filesystem;

const fs::path kImages = BOLE_VISP_IMAGES_DIR;

std::string messageOf(const std::string &path)
{
  return test::messageOf([&] { readCao(path); });
}

class CaoReader : public testing::Test
{
protected:
  std::string file(const std::string &text) const { return m_folder.write("model.cao", text); }
  test::TemporaryFolder m_folder;
  const std::string m_path = m_folder / "model.cao";
};

TEST_F(CaoReader, ReadsWhatItWrote)
{
  const Cylinder a{{1, 2, 0.1}, {1.1, 2, 4}, 0.15, "tree 7"}, b{{-3, 0.5, 0}, {-3, 0.5, 2.5}, 0.3, ""};
  writeCao(m_path, {a, b}, "two trunks");
  const std::vector<Cylinder> read = readCao(m_path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_LT((read[0].foot - a.foot).norm() + (read[0].top - a.top).norm() + (read[1].top - b.top).norm(), 1e-6);
  EXPECT_EQ(read[0].name, "tree 7");
  EXPECT_EQ(read[1].name, "");
  EXPECT_DOUBLE_EQ(read[1].radius, 0.3);
}

TEST_F(CaoReader, ViSPsCylinderModelsAreReadWhateverTheirLineEndings)
{
  for (const char *name : {"cylinder_cao_model_linux_line_ending.cao", "cylinder_cao_model_windows_line_ending.cao"}) {
    const fs::path path = kImages / "mbt-cao" / name;
    if (!fs::exists(path))
      GTEST_SKIP() << path << " is absent: package visp-images-data";
    EXPECT_EQ(test::textOf(path).find('\r') != std::string::npos,
              std::string(name).find("windows") != std::string::npos);
    const std::vector<Cylinder> read = readCao(path.string());
    ASSERT_EQ(read.size(), 1u);
    EXPECT_EQ(read[0].radius, 1);
    EXPECT_EQ(read[0].foot, Eigen::Vector3d(0, 0, 1));
    EXPECT_EQ(read[0].top, Eigen::Vector3d(0, 0, -1));
  }
}

TEST_F(CaoReader, TheCylinderBesideACubeIsRead)
{
  const fs::path path = kImages / "mbt" / "cube_and_cylinder.cao";
  if (!fs::exists(path))
    GTEST_SKIP() << path << " is absent: package visp-images-data";
  const std::vector<Cylinder> read = readCao(path.string());
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].radius, 0.04);
  EXPECT_THAT(messageOf((kImages / "mbt" / "cube.cao").string()), HasSubstr("cube.cao: no cylinder in it"));
}

TEST_F(CaoReader, ReadsWhatViSPReads)
{
  const std::string head = "\xEF\xBB\xBFV1\n\n2 points\n0 0 0 A\n0 0 3\n0\n0\n1\n2 0 1 name=front\n";
  const auto namesOf = [this](const std::string &text) {
    std::string names;
    for (const Cylinder &cylinder : readCao(file(text)))
      names += cylinder.name + ";";
    return names;
  };
  EXPECT_EQ(namesOf(head + "1\n0 1 0.1\n"), ";") << "no circles";
  EXPECT_EQ(namesOf(head + "1 # cylinder\n0 1 0.1 name=oak useLod=true\n1\n0.1 0 1 1\n"), "oak;");
  EXPECT_EQ(namesOf(head + "1\n0 1 0.1 useLod=true name=\"old oak\" minLineLengthThreshold=40.0\n0\n"), "old oak;");
  EXPECT_EQ(namesOf("V2\n2\n0 0 0 120 40\n0 0 3 121 80\n0\n0\n0\n1\n0 1 0.1\n0\n"), ";");
}

TEST_F(CaoReader, AModelInMillimetresOrOneThatLiesIsNoWood)
{
  const std::string tail = "0\n0\n0\n1\n0 1 ";
  EXPECT_THAT(messageOf(file("V1\n2\n5000 0 0\n5000 0 3000\n" + tail + "150\n")),
              HasSubstr(":9: radius = 150, must be above 0 and at most 5 m (millimetres?)"));
  EXPECT_THAT(messageOf(file("V1\n2\n50000 0 0\n50000 0 3000\n" + tail + "4\n")),
              HasSubstr(":9: point 0 is 50000 m from the origin"));
  file("V1\n2\n0 0 0.2\n3 0 0.2\n" + tail + "0.15 name=log\n");
  EXPECT_EQ(readCao(m_path).size(), 1u);
  EXPECT_REFUSED("cylinder 1 (log) lies: its axis is 90 degrees off z, which is up, must be", readTrunkModel(m_path));
}

TEST_F(CaoReader, SaysFileLineAndWhatMustBeThere)
{
  const std::string head = "V1\n2\n0 0 0\n0 0 3\n0\n0\n0\n";
  EXPECT_THAT(messageOf("/nowhere.cao"), HasSubstr("/nowhere.cao: no such file"));
  EXPECT_THAT(messageOf(file("V9\n")), HasSubstr(":1: version = V9, must be V1"));
  EXPECT_THAT(messageOf(file("V1\n1\n0 zero 0\n")), HasSubstr(":3: '0 zero 0', must be three numbers"));
  EXPECT_THAT(messageOf(file(head)), HasSubstr(".cao: no cylinder in it"));
  EXPECT_THAT(messageOf(file(head + "1\n")), HasSubstr(":9: the file ends, must go on with a cylinder"));
  EXPECT_THAT(messageOf(file("V1\n1\n0,5 0 0\n")), HasSubstr(":3: '0,5 0 0', must be three numbers"));
  EXPECT_THAT(messageOf(file(head + "1\n0 2 0.1\n0\n")), HasSubstr(":9: point = 2, must be 0 .. 1"));
  EXPECT_THAT(messageOf(file(head + "1\n0 1 -0.1\n0\n")), HasSubstr(":9: radius = -0.1, must be above 0"));
  EXPECT_THAT(messageOf(file(head + "1\n0 0 0.1\n0\n")), HasSubstr(":9: the two points of the axis must differ"));
  EXPECT_THAT(messageOf(file("V1\nload(\"other.cao\")\n")), HasSubstr(":2:"));
  EXPECT_EQ(messageOf(file(head + "1\n0 1 0.1 name=\"oak\" # a comment\n0\n")), "");
}

TEST_F(CaoReader, WritingToAFolderThatIsNotThereIsRefused)
{
  EXPECT_THROW(writeCao("/nowhere/model.cao", {}), vpException);
}

class TrunkSettingsFile : public testing::Test
{
protected:
  TrunkSettings read(const std::string &text) const { return readTrunkSettings(m_folder.write("t.xml", text), {}); }
  std::string messageOf(const std::string &text) const
  {
    return test::messageOf([&] { read(text); });
  }
  test::TemporaryFolder m_folder;
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
