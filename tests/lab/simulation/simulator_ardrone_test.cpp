// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "simulation/vpSimulatorArDrone.h"
#include "support/units.h"

using namespace bole;

namespace
{
Forest clearing()
{
  ForestOptions options;
  options.density = 0.02;
  options.undergrowth = options.saplings = options.crown_leaves = 0;
  return Forest::plant(options, {{0, 0, 1}, {4, 0, 1}}, {});
}

vpSimulatorArDrone::Options calm()
{
  vpSimulatorArDrone::Options options;
  options.body.gust = options.body.velocity_noise = 0;
  options.renderer.samples_per_pixel = 1;
  options.renderer.camera.pinhole = {50, 50, 40, 30, 80, 60};
  return options;
}

vpColVector velocity(double vx, double vy, double vz, double wz)
{
  vpColVector v(6, 0.0);
  v[0] = vx, v[1] = vy, v[2] = vz, v[5] = wz;
  return v;
}

void takeOff(vpSimulatorArDrone &robot)
{
  robot.setMaxTranslationVelocity(3);
  robot.setMaxRotationVelocity(3);
  robot.open(vpSimulatorArDrone::Permission::fly);
  robot.takeOff();
  for (int k = 0; k < 50; ++k) {
    robot.hover();
    robot.advance(0.1);
  }
}

void command(vpSimulatorArDrone &robot, const vpColVector &v, double seconds,
             vpRobot::vpControlFrameType frame = vpRobot::REFERENCE_FRAME)
{
  for (int k = 0; k < std::lround(10 * seconds); ++k) {
    robot.setVelocity(frame, v);
    robot.advance(0.1);
  }
}

TEST(SimulatorArDrone, DoesNothingWithoutPermission)
{
  vpSimulatorArDrone robot(clearing(), calm());
  robot.open(vpSimulatorArDrone::Permission::none);
  EXPECT_FALSE(robot.isOpen());
  EXPECT_THROW(robot.takeOff(), vpException);
  EXPECT_THROW(robot.setVelocity(vpRobot::REFERENCE_FRAME, vpColVector(6, 0.0)), vpException);
  EXPECT_THROW(robot.emergency(), vpException);
  robot.advance(1);
  EXPECT_FALSE(robot.isInAir());
}

TEST(SimulatorArDrone, SettlesWhereTheProportionalLawBalancesTheDrag)
{
  const auto options = calm();
  vpSimulatorArDrone robot(clearing(), options);
  takeOff(robot);
  command(robot, velocity(0.8, 0, 0, 0), 12);
  const double push = 9.81 * kLargestTilt * options.gain; // of the law, for small tilts
  EXPECT_NEAR(robot.body().measuredVelocity().x(), 0.8 * push / (push + options.body.drag), 0.02);
}

TEST(SimulatorArDrone, ObeysTheCameraFrame)
{
  vpSimulatorArDrone robot(clearing(), calm());
  takeOff(robot);
  const double height = robot.body().pose().t.z();
  vpColVector v(6, 0.0);
  v[0] = 0.5;  // right
  v[1] = -0.3; // up
  v[4] = -0.5; // to the left
  command(robot, v, 2, vpRobot::CAMERA_FRAME);
  EXPECT_LT(robot.body().measuredVelocity().y(), -0.1);
  EXPECT_NEAR(robot.body().pose().t.z() - height, 2 * 0.3, 0.2);
  const Pose wMb = robot.body().pose();
  EXPECT_NEAR(std::atan2(wMb.R(1, 0), wMb.R(0, 0)), 1, 0.15);
}

TEST(SimulatorArDrone, TheWatchdogHoversAndThenLandsWhenCommandsGoStale)
{
  vpSimulatorArDrone robot(clearing(), calm());
  takeOff(robot);
  command(robot, velocity(1, 0, 0, 0), 2);
  EXPECT_EQ(robot.watchdog(), vpSimulatorArDrone::Watchdog::content);
  robot.advance(1.5);
  EXPECT_EQ(robot.watchdog(), vpSimulatorArDrone::Watchdog::hovers);
  EXPECT_LT(robot.body().measuredVelocity().x(), 0.3);
  robot.advance(6);
  EXPECT_FALSE(robot.isInAir());
}

TEST(SimulatorArDrone, LandsByTheLawsAsTheRealOneDoes)
{
  auto options = calm();
  options.battery_s = 20;
  vpSimulatorArDrone tired(clearing(), options);
  takeOff(tired); // 5 s
  command(tired, velocity(0.2, 0, 0, 0), 12);
  EXPECT_TRUE(tired.isInAir());
  command(tired, velocity(0.2, 0, 0, 0), 1.2);
  EXPECT_FALSE(tired.watchdog() == vpSimulatorArDrone::Watchdog::content);
  tired.advance(5);
  EXPECT_FALSE(tired.isInAir());

  vpSimulatorArDrone blind(clearing(), calm());
  takeOff(blind);
  command(blind, velocity(0.8, 0, 0, 0), 2);
  blind.loseNavdata(true);
  command(blind, velocity(0.8, 0, 0, 0), 2);
  EXPECT_EQ(blind.brokenLaw(), "no navdata");
  EXPECT_LT(blind.body().velocity().norm(), 0.1);
  EXPECT_TRUE(blind.isInAir());
  command(blind, velocity(0.8, 0, 0, 0), 6);
  EXPECT_FALSE(blind.isInAir());
}

TEST(SimulatorArDrone, StaysWithinItsFenceAndItsBandOfHeightsInWind)
{
  auto options = calm();
  options.gain = 0.6;
  options.body.gust = 0.1;
  options.body.velocity_noise = 0.03;
  options.laws.fence = 3;
  options.laws.highest = 2;
  vpSimulatorArDrone robot(clearing(), options);
  takeOff(robot);
  for (const double heading : {0.0, 1.5, 3.0, 4.5}) {
    command(robot, velocity(std::cos(heading), std::sin(heading), 0.5, 0), 8);
    const Eigen::Vector3d p = robot.body().pose().t;
    EXPECT_LT(p.head<2>().norm(), 3.4); // what it reckons by its own velocity drifts
    EXPECT_GT(p.head<2>().norm(), 2);
    EXPECT_NEAR(p.z(), 2, 0.2);
  }
}

TEST(SimulatorArDrone, LandsAndStopsAtOnceInAnEmergency)
{
  vpSimulatorArDrone robot(clearing(), calm());
  takeOff(robot);
  EXPECT_TRUE(robot.isInAir());
  EXPECT_NEAR(robot.body().pose().t.z(), kTakeOffHeight, 0.06);
  robot.emergency();
  EXPECT_FALSE(robot.isInAir());
  robot.takeOff();
  robot.advance(2);
  EXPECT_TRUE(robot.isInAir());
  robot.land();
  robot.advance(6);
  EXPECT_FALSE(robot.isInAir());
  EXPECT_NEAR(robot.body().pose().t.z(), 0.05, 0.01);
}

TEST(SimulatorArDrone, FramesComeAtTheirRateAndLateWithAGyroThatIntegratesToTheirTurn)
{
  auto options = calm();
  options.sensors.gyro_noise = options.sensors.gyro_bias = 0;
  vpSimulatorArDrone robot(clearing(), options);
  takeOff(robot);
  Frame last;
  for (int k = 0; k < 10; ++k) {
    Frame frame;
    robot.setVelocity(vpRobot::REFERENCE_FRAME, velocity(1, 0.5, 0, 1));
    ASSERT_TRUE(robot.next(frame));
    EXPECT_NEAR(robot.time() - 1e-9 * static_cast<double>(frame.stamp_ns), options.video_delay_s, 0.006);
    EXPECT_EQ(frame.index, static_cast<std::size_t>(k));
    EXPECT_EQ(frame.image.getWidth(), 80u);
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    for (const GyroSample &sample : frame.gyro)
      turn = turn * expSo3(0.005 * sample.rate);
    if (k > 0) {
      EXPECT_EQ(frame.stamp_ns - last.stamp_ns, 100000000);
      ASSERT_EQ(frame.gyro.size(), 20u);
      EXPECT_LT(logSo3(turn.transpose() * last.wMb_truth->R.transpose() * frame.wMb_truth->R).norm(), 1e-3);
      EXPECT_GT(k < 3 ? 1 : logSo3(turn).norm(), 0.05);
    }
    last = frame;
  }
}

TEST(SimulatorArDrone, SameSeedAndCommandsSameFlight)
{
  auto options = calm();
  options.body.gust = 0.2;
  Frame frames[2];
  for (Frame &frame : frames) {
    options.setSeed(7);
    vpSimulatorArDrone robot(clearing(), options);
    takeOff(robot);
    for (int k = 0; k < 3; ++k) {
      robot.setVelocity(vpRobot::REFERENCE_FRAME, velocity(1, 0, 0, 0));
      frame = Frame();
      robot.next(frame);
    }
  }
  EXPECT_TRUE(frames[0].image == frames[1].image);
  EXPECT_EQ(frames[0].wMb_truth->t, frames[1].wMb_truth->t);
  EXPECT_EQ(frames[0].wMb_odometry->t, frames[1].wMb_odometry->t);
}

TEST(SimulatorArDrone, ReportsTheNearestBarkItPassedAndItsPoseFilter)
{
  const Forest forest = clearing();
  vpSimulatorArDrone robot(forest, calm());
  vpColVector q;
  EXPECT_THROW(robot.getPosition(vpRobot::REFERENCE_FRAME, q), vpException);
  takeOff(robot);
  EXPECT_NEAR(robot.leastClearance(), forest.distanceToBark({0, 0, 1}), 0.2);
  Frame frame;
  robot.next(frame);
  robot.getPosition(vpRobot::REFERENCE_FRAME, q);
  EXPECT_DOUBLE_EQ(q[2], frame.wMb_odometry->t.z());
}
} // namespace
