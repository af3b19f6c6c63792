// SPDX-License-Identifier: GPL-2.0-or-later
#include "flight.h"
#include "support/test.h"

#include <bole/pose.h>
#include <bole/vpRobotArDrone.h>
#include <cstring>
#include <visp3/robot/vpRobotException.h>

using namespace bole;
using test::eventually;

namespace
{
struct Flying
{
  std::unique_ptr<ArDroneEmulator> emulator = test::emulate(2, 40, {}, true);
  vpArDroneGrabber grabber{emulator->address()};
  Flying()
  {
    vpImage<unsigned char> image;
    grabber.open(image);
    eventually([&] { return grabber.getLink().body().has_value(); });
  }
  /// The newest command of that name.
  std::optional<AtCommand> last(const std::string &name) const
  {
    const auto commands = emulator->commands();
    for (auto command = commands.rbegin(); command != commands.rend(); ++command)
      if (command->name == name)
        return *command;
    return std::nullopt;
  }
  bool inAir() const
  {
    const auto reference = last("REF");
    return reference && (std::stol(reference->arguments[0]) & 1 << 9) != 0;
  }
};

/// The inverse of atFloat().
float atFloatValue(const std::string &text)
{
  const std::int32_t bits = std::stoi(text);
  float value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

vpRobotArDrone::Options patient()
{
  vpRobotArDrone::Options options;
  options.laws.hover_after_s = 1.9; // a machine under load must not look like a dead tracker
  options.laws.land_after_s = 50;
  return options;
}

vpColVector twist(std::initializer_list<double> values) { return vpColVector(std::vector<double>(values)); }

/// x right, y down, z forward of a camera that stands 0.1 m before the body's origin.
vpHomogeneousMatrix ahead()
{
  Eigen::Matrix3d bRc;
  bRc << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return Pose{bRc, {0.1, 0, 0}}.toVisp();
}
} // namespace

TEST(RobotArDrone, SendsNothingWithoutPermission)
{
  Flying flying;
  vpRobotArDrone robot(flying.grabber);
  robot.open(vpRobotArDrone::Permission::none);
  EXPECT_FALSE(robot.isOpen());
  EXPECT_THROW(robot.takeOff(), vpException);
  EXPECT_THROW(robot.setVelocity(vpRobot::REFERENCE_FRAME, vpColVector(6, 0.0)), vpException);
  EXPECT_THROW(robot.emergency(), vpException);
  EXPECT_FALSE(flying.last("REF"));
  EXPECT_FALSE(flying.last("PCMD"));
}

/// One whose robot has taken off.
struct InAir : Flying
{
  vpRobotArDrone robot;
  explicit InAir(const vpRobotArDrone::Options &options = patient()) : robot(grabber, options)
  {
    robot.open(vpRobotArDrone::Permission::fly);
    robot.takeOff();
    robot.setMaxTranslationVelocity(10);
    robot.setMaxRotationVelocity(3);
  }
  /// The command that moves it.
  AtCommand moves(vpRobot::vpControlFrameType frame, const vpColVector &v)
  {
    robot.setVelocity(frame, v);
    EXPECT_TRUE(eventually([&] { return last("PCMD") && last("PCMD")->arguments[0] == "1"; }));
    return last("PCMD").value_or(AtCommand());
  }
};

TEST(RobotArDrone, TakesOffMovesAndLands)
{
  InAir flying;
  ASSERT_TRUE(eventually([&] { return flying.inAir(); }));
  // Camera's z is forward and its y down: faster than it flies, so nose down; climbing; turning left.
  const AtCommand move = flying.moves(vpRobot::CAMERA_FRAME, twist({0, -0.35, 8, 0, -0.435, 0}));
  ASSERT_EQ(move.arguments.size(), 5u);
  EXPECT_FLOAT_EQ(atFloatValue(move.arguments[2]), -0.5f);           // pitch, at its limit
  EXPECT_NEAR(atFloatValue(move.arguments[3]), 0.5, 1e-3);           // 0.35 of 0.7 m/s
  EXPECT_NEAR(atFloatValue(move.arguments[4]), -0.435 / 1.74, 1e-3); // left is counter-clockwise

  flying.robot.land();
  ASSERT_TRUE(eventually([&] { return !flying.inAir(); }));
  EXPECT_EQ(flying.emulator->counters().out_of_sequence, 0u);
}

TEST(RobotArDrone, LeftwardTiltsTheLeftSideDown)
{
  InAir flying;
  const AtCommand move = flying.moves(vpRobot::REFERENCE_FRAME, twist({0, 8, 0, 0, 0, 0}));
  ASSERT_EQ(move.arguments.size(), 5u);
  EXPECT_FLOAT_EQ(atFloatValue(move.arguments[1]), -0.5f);
}

TEST(RobotArDrone, TheWatchdogHoversAndThenLandsWhenCommandsGoStale)
{
  vpRobotArDrone::Options options;
  options.laws.hover_after_s = 0.1;
  options.laws.land_after_s = 0.6;
  InAir flying(options);
  flying.robot.setVelocity(vpRobot::REFERENCE_FRAME, vpColVector(6, 0.1));
  ASSERT_TRUE(eventually([&] { return flying.last("PCMD") && flying.last("PCMD")->arguments[0] == "0"; })); // hovers
  ASSERT_TRUE(eventually([&] { return flying.last("REF") && !flying.inAir(); }));                           // lands
  const auto commands = flying.emulator->commands();
  EXPECT_TRUE(std::any_of(commands.begin(), commands.end(), [](const AtCommand &c) {
    return c.name == "REF" && (std::stol(c.arguments[0]) & 1 << 9) != 0;
  }));
  EXPECT_TRUE(eventually([&] { return flying.robot.watchdog() == vpRobotArDrone::Watchdog::idle; }));
}

TEST(RobotArDrone, KeepsTheFlightLaws)
{
  vpRobotArDrone::Options options = patient();
  options.laws.least_battery = 0.81; // the emulated drone says 80 per cent
  InAir flying(options);
  EXPECT_TRUE(eventually([&] { return flying.robot.brokenLaw() == "battery"; }));
  EXPECT_TRUE(eventually([&] { return flying.last("REF") && !flying.inAir(); }));
}

TEST(RobotArDrone, LandsADroneThatItTookOffWhenItIsDestroyed)
{
  Flying flying;
  {
    vpRobotArDrone robot(flying.grabber, patient());
    robot.open(vpRobotArDrone::Permission::fly);
    robot.takeOff();
    ASSERT_TRUE(eventually([&] { return flying.inAir(); }));
  }
  EXPECT_TRUE(eventually([&] { return !flying.inAir(); }));
}

TEST(BodyVelocity, TurnsTheCamerasTwistIntoTheBodys)
{
  const Eigen::Vector4d v = bodyVelocity(vpRobot::CAMERA_FRAME, twist({0.1, 0.2, 0.3, 0, 0.4, 0}), ahead(), 1, 1);
  // to the right is -y, down is -z; turning right about the camera, the origin behind it swings to the left
  EXPECT_TRUE(v.isApprox(Eigen::Vector4d(0.3, -0.1 + 0.04, -0.2, -0.4), 1e-12)) << v.transpose();
}

TEST(BodyVelocity, SlowsTheWholeTwistWhereOneComponentIsTooFast)
{
  const Eigen::Vector4d v = bodyVelocity(vpRobot::REFERENCE_FRAME, twist({2, 1, 0, 0, 0, 0}), ahead(), 0.5, 1);
  EXPECT_TRUE(v.isApprox(Eigen::Vector4d(0.5, 0.25, 0, 0), 1e-12)) << v.transpose();
}

TEST(BodyVelocity, RefusesWhatIsNoVelocity)
{
  const auto ask = [](vpRobot::vpControlFrameType frame, const vpColVector &v) {
    return bodyVelocity(frame, v, ahead(), 1, 1);
  };
  EXPECT_THROW(ask(vpRobot::REFERENCE_FRAME, twist({0, 0, 0, 0})), vpRobotException);
  EXPECT_THROW(ask(vpRobot::JOINT_STATE, vpColVector(6, 0.0)), vpRobotException);
  EXPECT_THROW(ask(vpRobot::CAMERA_FRAME, twist({0, 0, std::numeric_limits<double>::quiet_NaN(), 0, 0, 0})),
               vpRobotException);
}
