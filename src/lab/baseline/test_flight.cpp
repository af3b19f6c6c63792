// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/contender.h"

#include "support/text.h"
#include "support/units.h"
#include <bole/open_source.h>
#include <bole/pose.h>

#include <Eigen/Dense>

#include <filesystem>
#include <fmt/format.h>
#include <random>
#include <visp3/core/vpException.h>
#include <visp3/io/vpImageIo.h>
#include <visp3/mbt/vpMbGenericTracker.h>

namespace bole
{
namespace fs = std::filesystem;
using Eigen::Vector3d;

namespace
{
Eigen::Matrix3d turned(double yaw) { return expSo3({0, 0, yaw}); }

/// Upright cylinders from 0.1 to 4 m over the ground; far trunks, whose radius is not known, are none.
std::vector<Cylinder> readTrees(const std::string &folder)
{
  std::vector<Cylinder> trunks;
  for (const TruthTrunk &truth : readTruthTrunks(folder)) {
    if (truth.radius <= 0)
      continue;
    Cylinder trunk;
    trunk.name = fmt::format("tree {}", truth.id);
    trunk.foot = {truth.xy.x(), truth.xy.y(), 0.1};
    trunk.top = {truth.xy.x(), truth.xy.y(), 4};
    trunk.radius = truth.radius;
    trunks.push_back(trunk);
  }
  return trunks;
}
} // namespace

std::vector<Cylinder> TestFlight::trunksWithin(double range_m) const
{
  std::vector<Cylinder> near;
  for (const Cylinder &trunk : trunks) {
    const Vector3d axis = trunk.axis();
    for (const TestFrame &frame : frames) {
      const Vector3d away = frame.cMo.inverse().t - trunk.foot;
      if ((away - axis.dot(away) * axis).norm() < range_m) {
        near.push_back(trunk);
        break;
      }
    }
  }
  return near;
}

Pose TestFlight::predicted(std::size_t k, const Pose &cMo) const
{
  const auto &now = frames[k].odometry, &before = frames[k - 1].odometry;
  if (!now || !before)
    return cMo;
  if (!upright)
    return *now * before->inverse() * cMo;
  const Eigen::Matrix3d cRb = forwardCamera().R.transpose();
  const Pose was = cMo.inverse(), odometry_was = before->inverse(), odometry_is = now->inverse();
  const double yaw_was = yawOf(was.R * cRb), odometry_yaw_was = yawOf(odometry_was.R * cRb);
  const Vector3d step = turned(yaw_was - odometry_yaw_was) * (odometry_is.t - odometry_was.t);
  Pose is;
  is.R = turned(yaw_was - odometry_yaw_was) * odometry_is.R;
  is.t = {was.t.x() + step.x(), was.t.y() + step.y(), odometry_is.t.z()};
  return is.inverse();
}

Matrix6d TestFlight::predictedCovariance(const Pose &predicted, const Pose &cMo_before, const Matrix6d &before) const
{
  const Matrix6d carry = adjoint(predicted * cMo_before.inverse());
  Matrix6d A = Matrix6d::Zero(); // world axes to camera axes, both at the camera
  A.topLeftCorner<3, 3>() = A.bottomRightCorner<3, 3>() = predicted.R;
  const Matrix6d step = A * step_sigma.array().square().matrix().asDiagonal() * A.transpose();
  const Matrix6d known = A * absolute_sigma.array().square().inverse().matrix().asDiagonal() * A.transpose();
  return ((carry * before * carry.transpose() + step).inverse() + known).inverse();
}

TestFlight readAslFlight(const std::string &folder)
{
  const auto source = openSource(folder);
  TestFlight flight;
  flight.name = source->name();
  flight.camera = source->camera();
  flight.trunks = readTrees(folder);
  const Pose bMc = source->bMc();
  // the pose filter of the rendered flights: drifts by 1.2 cm a frame in the plane and slowly in yaw; its height
  // (1.9 cm) and attitude (0.23 degrees) are noisy but do not drift
  flight.step_sigma << 0.013, 0.013, 0.03, 0.006, 0.006, 0.002;
  flight.absolute_sigma << 1e3, 1e3, 0.02, 0.004, 0.004, 1e3;
  Frame frame;
  while (source->next(frame)) {
    if (!frame.wMb_truth)
      throw badValue("{}: frame {} has no true pose", folder, frame.index);
    if (frame.status != FrameStatus::ok)
      throw badValue("{}: frame {}: {}", folder, frame.index, frame.message);
    TestFrame test;
    test.image = frame.image;
    test.cMo = (*frame.wMb_truth * bMc).inverse();
    if (frame.wMb_odometry)
      test.odometry = (*frame.wMb_odometry * bMc).inverse();
    flight.frames.push_back(std::move(test));
  }
  return flight;
}

TestFlight readCubeFlight(const std::string &folder, int max_frames)
{
  TestFlight flight;
  flight.name = "cube-and-cylinder";
  flight.camera = {547.7367575, 542.0744058, 338.7036994, 234.5083345, 640, 480};
  Cylinder cylinder;
  cylinder.foot = {-0.170, -0.030, 0};
  cylinder.top = {-0.170, -0.030, 0.250};
  cylinder.radius = 0.040;
  cylinder.name = "cylinder";
  flight.trunks = {cylinder};

  vpMbGenericTracker cube(1, vpMbGenericTracker::EDGE_TRACKER | vpMbGenericTracker::KLT_TRACKER);
  cube.loadConfigFile((fs::path(folder) / "cube.xml").string(), false);
  cube.loadModel((fs::path(folder) / "cube.cao").string());
  cube.setProjectionErrorComputation(true);
  vpHomogeneousMatrix cMo(0.02231950571, 0.1071368004, 0.5071128378, 2.100485509, 1.146812236, -0.4560126437);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const double sigma_m = 0.002, sigma_rad = 0.004;
  for (int k = 0; k < max_frames; ++k) {
    const fs::path path = fs::path(folder) / "cube" / fmt::format("image{:04d}.pgm", k);
    if (!fs::exists(path))
      break;
    TestFrame frame;
    vpImageIo::read(frame.image, path.string());
    try {
      if (flight.frames.empty())
        cube.initFromPose(frame.image, cMo);
      cube.track(frame.image);
    }
    catch (const vpException &) {
      break;
    }
    if (cube.getProjectionError() > 30)
      break;
    cube.getPose(cMo);
    frame.cMo = Pose::fromVisp(cMo);
    if (flight.frames.empty())
      frame.odometry = frame.cMo;
    else {
      Pose motion = frame.cMo * flight.frames.back().cMo.inverse();
      motion.t += sigma_m * Vector3d(normal(random), normal(random), normal(random));
      motion.R = motion.R * expSo3(sigma_rad * Vector3d(normal(random), normal(random), normal(random)));
      frame.odometry = motion * *flight.frames.back().odometry;
    }
    flight.frames.push_back(std::move(frame));
  }
  if (flight.frames.empty())
    throw ioError("{}: no cube/image0000.pgm that ViSP's tracker can follow", folder);
  flight.upright = false;
  flight.step_sigma << Vector3d::Constant(sigma_m), Vector3d::Constant(sigma_rad);
  return flight;
}
} // namespace bole
