// SPDX-License-Identifier: GPL-2.0-or-later
// The control law on exact features: a camera that moves as it is told, before a trunk.
#include <bole/geometry/so3.h>
#include <bole/input/camera_file.h>
#include <bole/tasks/trunk_task.h>

#include <Eigen/Geometry>

#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
constexpr double kStep = 0.02;

struct Flight
{
  Trunk trunk;
  Pose wMb{Eigen::Matrix3d::Identity(), {0, 0, 1.2}};
  Pose bMc = forwardCamera();

  vpFeatureTrunk feature() const
  {
    vpFeatureTrunk seen;
    seen.buildFrom(trunk, wMb * bMc);
    return seen;
  }
  void move(const Eigen::Vector4d &v)
  {
    wMb = {wMb.R * expSo3({0, 0, kStep * v(3)}), wMb.t + wMb.R * Eigen::Vector3d(kStep * v.head<3>())};
  }
  double distance() const { return feature().distance(); }
};

Flight before(double x, double y, double radius)
{
  Flight flight;
  flight.trunk.xy = {x, y};
  flight.trunk.log_radius = std::log(radius);
  return flight;
}

TEST(TrunkTask, TheErrorDecaysAtTheGain)
{
  Flight flight = before(3.3, 0.4, 0.2);
  TrunkTaskOptions options;
  options.distance = 3;
  options.integral = 0;
  options.gain = 0.5;
  TrunkTask task(flight.bMc, options);
  const double bearing = flight.feature().bearing(), ratio = std::log(flight.distance() / 3);
  for (int k = 0; k < 100; ++k) // 2 s
    flight.move(task.velocityFor(flight.feature(), 0.2, kStep));
  const double left = std::exp(-0.5 * 2);
  EXPECT_NEAR(flight.feature().bearing() / bearing, left, 0.03);
  EXPECT_NEAR(std::log(flight.distance() / 3) / ratio, left, 0.03);
}

TEST(TrunkTask, HoldsTheBearingAskedForAndNotOnlyStraightAhead)
{
  Flight flight = before(4, -0.5, 0.15);
  TrunkTaskOptions options;
  options.bearing = 0.2;
  options.ratio = 0.06;
  TrunkTask task(flight.bMc, options);
  for (int k = 0; k < 2000; ++k)
    flight.move(task.velocityFor(flight.feature(), 0.15, kStep));
  EXPECT_NEAR(flight.feature().bearing(), 0.2, 1e-3);
  EXPECT_NEAR(flight.distance(), 0.15 / 0.06, 1e-2);
}

TEST(TrunkTask, AWrongRadiusSlowsButDoesNotMoveTheRatioItKeeps)
{
  Flight flight = before(4, 0, 0.15);
  TrunkTaskOptions options;
  options.ratio = 0.06;
  TrunkTask task(flight.bMc, options);
  for (int k = 0; k < 2500; ++k)
    flight.move(task.velocityFor(flight.feature(), 0.25, kStep)); // believes 0.25 m
  EXPECT_NEAR(std::exp(flight.feature().logRatio()), 0.06, 1e-3);
}

TEST(TrunkTask, CirclesAtTheRatioAndTheSpeedAskedFor)
{
  Flight flight = before(2.5, 0, 0.15);
  TrunkTaskOptions options;
  options.ratio = 0.06;
  options.speed = 0.5;
  TrunkTask task(flight.bMc, options);
  double turned = 0;
  for (int k = 0; k < 1600; ++k) { // 32 s at 0.5 m/s round 2.5 m is once round
    const Eigen::Vector2d a = flight.wMb.t.head<2>() - flight.trunk.xy;
    flight.move(task.velocityFor(flight.feature(), 0.15, kStep));
    const Eigen::Vector2d b = flight.wMb.t.head<2>() - flight.trunk.xy;
    turned += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
    ASSERT_NEAR(flight.feature().bearing(), 0, 0.01);
    ASSERT_NEAR(flight.distance(), 2.5, 0.05);
  }
  EXPECT_NEAR(std::abs(turned), 32 * 0.5 / 2.5, 0.1);
}

TEST(TrunkTask, TheIntegralTakesOutWhatTheDroneDoesNotObey)
{
  const auto finalDistance = [](double integral) {
    Flight flight = before(3, 0, 0.15);
    TrunkTaskOptions options;
    options.ratio = 0.05;
    options.integral = integral;
    TrunkTask task(flight.bMc, options);
    for (int k = 0; k < 3000; ++k)
      flight.move(task.velocityFor(flight.feature(), 0.15, kStep) + Eigen::Vector4d(-0.05, 0, 0, 0)); // drifts back
    return flight.distance();
  };
  EXPECT_GT(finalDistance(0), 3.05);
  EXPECT_NEAR(finalDistance(0.15), 3, 0.005);
}

TEST(TrunkTask, KeepsItsLargestSpeed)
{
  Flight flight = before(12, 3, 0.2);
  TrunkTaskOptions options;
  options.largest_speed = 0.4;
  TrunkTask task(flight.bMc, options);
  EXPECT_LE(task.velocityFor(flight.feature(), 0.2, kStep).head<2>().norm(), 0.4 + 1e-9);
}

TEST(TrunkTask, RefusesOptionsOutOfRange)
{
  TrunkTaskOptions options;
  options.gain = 0;
  EXPECT_THROW(TrunkTask(forwardCamera(), options), vpException);
}
} // namespace
} // namespace bole
