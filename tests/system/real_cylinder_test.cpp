// SPDX-License-Identifier: GPL-2.0-or-later
// A real cylinder: ViSP's sequence of a cube and a cylinder that are pushed over a table by hand. ViSP's tracker
// follows the cube alone, which gives the odometry of the camera in the cube's frame; bole maps the cylinder in it.
#include "input/trajectory.h"
#include "output/trunks_csv.h"
#include <bole/open_source.h>
#include <bole/pose.h>

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <visp3/io/vpImageIo.h>
#include <visp3/mbt/vpMbGenericTracker.h>

namespace
{
using namespace bole;
namespace fs = std::filesystem;

const std::string kImages = BOLE_VISP_IMAGES_DIR "/mbt/cube/image%04d.pgm";
// mbt/cube_and_cylinder.cao, in the frame of the cube [m]
const Eigen::Vector2d kAxis(-0.170, -0.030);
constexpr double kRadius = 0.040;

std::string imagePath(int number) { return fmt::format("{}/mbt/cube/image{:04d}.pgm", BOLE_VISP_IMAGES_DIR, number); }

/// The camera in the frame of the cube, image by image, as the body of a TUM file that looks ahead.
Trajectory cubeOdometry(double rate_hz)
{
  vpMbGenericTracker tracker;
  tracker.setTrackerType(vpMbGenericTracker::EDGE_TRACKER | vpMbGenericTracker::KLT_TRACKER);
  tracker.loadConfigFile(BOLE_VISP_IMAGES_DIR "/mbt/cube.xml");
  tracker.loadModel(BOLE_VISP_IMAGES_DIR "/mbt/cube.cao");
  Trajectory trajectory;
  for (int i = 0; fs::exists(imagePath(i)); ++i) {
    vpImage<unsigned char> I;
    vpImageIo::read(I, imagePath(i));
    vpHomogeneousMatrix cMo(0.02231950571, 0.1071368004, 0.5071128378, 2.100485509, 1.146812236, -0.4560126437);
    if (i == 0)
      tracker.initFromPose(I, cMo);
    tracker.track(I);
    tracker.getPose(cMo);
    trajectory.push_back({std::llround(i * 1e9 / rate_hz), Pose::fromVisp(cMo).inverse() * forwardCamera().inverse()});
  }
  return trajectory;
}

const TrunkRecord *nearestConfirmed(const std::vector<TrunkRecord> &trunks)
{
  const TrunkRecord *nearest = nullptr;
  for (const TrunkRecord &trunk : trunks)
    if (trunk.status == TrunkStatus::confirmed &&
        (!nearest || (trunk.xy - kAxis).norm() < (nearest->xy - kAxis).norm()))
      nearest = &trunk;
  return nearest;
}

TEST(RealCylinder, IsMappedWhereItStandsAndAsThickAsItIs)
{
  if (!fs::exists(imagePath(0)))
    GTEST_SKIP() << "the Debian package visp-images-data is not installed";
  const std::string folder = testing::TempDir() + "bole_real_cylinder";
  fs::remove_all(folder);
  fs::create_directories(folder);
  writeTrajectory(folder + "/cube.tum", cubeOdometry(25));
  std::ofstream(folder + "/camera.yaml")
      << "resolution: [640, 480]\nintrinsics: [547.7367575, 542.0744058, 338.7036994, 234.5083345]\n";
  const std::string command = fmt::format(
      "{} track {} -o {}/run --camera {}/camera.yaml --odometry {}/cube.tum --rate 25 --config {}/config/tabletop.yaml",
      BOLE_EXECUTABLE, kImages, folder, folder, folder, BOLE_SOURCE_DIR);
  ASSERT_EQ(std::system(command.c_str()), 0) << command;

  const auto trunks = readTrunks(folder + "/run/trunks.csv");
  const TrunkRecord *cylinder = nearestConfirmed(trunks);
  ASSERT_NE(cylinder, nullptr) << "nothing confirmed, see " << folder;
  const double axis_error = (cylinder->xy - kAxis).norm();
  fmt::print("radius {:.1f} mm (true 40.0), axis {:.1f} mm off, {} observations; {} trunks in the map\n",
             1e3 * cylinder->radius, 1e3 * axis_error, cylinder->observations, trunks.size());
  EXPECT_NEAR(cylinder->radius, kRadius, 0.1 * kRadius);
  EXPECT_LT(axis_error, 0.015);
}
} // namespace
