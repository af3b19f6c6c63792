// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/drawn_trunks.h"

#include "mbt/cao_reader.h"
#include <bole/vpMbTrunkTracker.h>

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <unistd.h>
#include <visp3/core/vpException.h>
#include <visp3/mbt/vpMbGenericTracker.h>

namespace
{
using namespace bole;
using testing::HasSubstr;
namespace fs = std::filesystem;

const fs::path kImages = BOLE_VISP_IMAGES_DIR;

std::string messageOf(const std::string &path)
{
  try {
    readCao(path);
  }
  catch (const vpException &error) {
    return error.what();
  }
  return "";
}

class CaoReader : public testing::Test
{
protected:
  ~CaoReader() override { fs::remove(m_path); }
  std::string file(const std::string &text) const
  {
    std::ofstream(m_path, std::ios::binary) << text;
    return m_path;
  }
  const std::string m_path = testing::TempDir() + "cao_reader_" + std::to_string(::getpid()) + ".cao";
};

std::string contentOf(const fs::path &path)
{
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST_F(CaoReader, ReadsWhatItWrote)
{
  Cylinder a, b;
  a.foot = {1, 2, 0.1}, a.top = {1.1, 2, 4}, a.radius = 0.15, a.name = "tree 7";
  b.foot = {-3, 0.5, 0}, b.top = {-3, 0.5, 2.5}, b.radius = 0.3;
  writeCao(m_path, {a, b}, "two trunks");
  const std::vector<Cylinder> read = readCao(m_path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_LT((read[0].foot - a.foot).norm() + (read[0].top - a.top).norm() + (read[1].top - b.top).norm(), 1e-6);
  EXPECT_EQ(read[0].name, "tree 7");
  EXPECT_EQ(read[1].name, "");
  EXPECT_DOUBLE_EQ(read[1].radius, 0.3);
}

TEST_F(CaoReader, AModelOfAMapIsLoadedByOurTrackerAndByViSPsOwn)
{
  Trunk upright, leaning;
  upright.xy = {4, 0.8};
  leaning.xy = {5, -1}, leaning.lean = {0.05, -0.1};
  writeCao(m_path, {cylinderOf(upright, 0, 3, "1"), cylinderOf(leaning, 0.2, 2.5)}, "the trunks of a map");

  vpMbTrunkTracker ours;
  ours.loadModel(m_path);
  std::streambuf *const visp_says = std::cout.rdbuf(nullptr);
  vpMbGenericTracker visp;
  visp.setCameraParameters(PinholeCamera().toVisp());
  visp.loadModel(m_path);
  std::cout.rdbuf(visp_says);
  std::list<vpMbtDistanceCylinder *> cylinders;
  visp.getLcylinder(cylinders);
  ASSERT_EQ(cylinders.size(), 2u);

  // both draw the two borders of each trunk in the same places
  const Pose cMo = test::cameraAt({0, 0, 1.2}, 0.02, 0.03);
  const auto lines = ours.getModelForDisplay(320, 240, cMo.toVisp(), PinholeCamera().toVisp(), true);
  ASSERT_EQ(lines.size(), 4u);
  for (vpMbtDistanceCylinder *cylinder : cylinders) {
    vpCylinder limbs(*cylinder->c);
    limbs.track(cMo.toVisp());
    for (const auto &[rho, theta] :
         {std::pair(limbs.getRho1(), limbs.getTheta1()), std::pair(limbs.getRho2(), limbs.getTheta2())}) {
      double nearest_px = 1e9;
      for (const auto &line : lines) {
        const Eigen::Vector3d foot = PinholeCamera().ray({line[2], line[1]}),
                              top = PinholeCamera().ray({line[4], line[3]});
        const auto off = [rho = rho, theta = theta](const Eigen::Vector3d &m) {
          return 200 * std::abs(m.x() * std::cos(theta) + m.y() * std::sin(theta) - rho);
        };
        nearest_px = std::min(nearest_px, std::max(off(foot), off(top)));
      }
      EXPECT_LT(nearest_px, 1e-3);
    }
  }
}

TEST_F(CaoReader, ViSPsCylinderModelsAreReadWhateverTheirLineEndings)
{
  for (const char *name : {"cylinder_cao_model_linux_line_ending.cao", "cylinder_cao_model_windows_line_ending.cao"}) {
    const fs::path path = kImages / "mbt-cao" / name;
    if (!fs::exists(path))
      GTEST_SKIP() << path << " is absent: package visp-images-data";
    EXPECT_EQ(contentOf(path).find('\r') != std::string::npos, std::string(name).find("windows") != std::string::npos);
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
  try {
    readTrunkModel(m_path);
    FAIL() << "no exception";
  }
  catch (const vpException &error) {
    EXPECT_THAT(error.what(), HasSubstr("cylinder 1 (log) lies: its axis is 90 degrees off z, which is up, must be"));
  }
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
} // namespace
