// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/vpRobotArDrone.h>

#include "flight.h"

#include <cstring>
#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

using namespace bole;
using test::eventually;

namespace
{
/// The inverse of atFloat().
float atFloatValue(const std::string &text)
{
  const std::int32_t bits = std::stoi(text);
  float value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

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

vpRobotArDrone::Options patient()
{
  vpRobotArDrone::Options options;
  options.laws.hover_after_s = 1.9; // a machine under load must not look like a dead tracker
  options.laws.land_after_s = 50;
  return options;
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

TEST(RobotArDrone, TakesOffMovesAndLands)
{
  Flying flying;
  vpRobotArDrone robot(flying.grabber, patient());
  robot.open(vpRobotArDrone::Permission::fly);
  robot.takeOff();
  ASSERT_TRUE(eventually([&] { return flying.inAir(); }));
  robot.setMaxTranslationVelocity(10);
  robot.setMaxRotationVelocity(3);

  // Camera's z is forward and its y down: faster than it flies, so nose down; climbing; turning left.
  vpColVector v(6, 0.0);
  v[2] = 8;
  v[1] = -0.35;
  v[4] = -0.435;
  robot.setVelocity(vpRobot::CAMERA_FRAME, v);
  ASSERT_TRUE(eventually([&] { return flying.last("PCMD") && flying.last("PCMD")->arguments[0] == "1"; }));
  const auto move = flying.last("PCMD");
  EXPECT_FLOAT_EQ(atFloatValue(move->arguments[2]), -0.5f);           // pitch, at its limit
  EXPECT_NEAR(atFloatValue(move->arguments[3]), 0.5, 1e-3);           // 0.35 of 0.7 m/s
  EXPECT_NEAR(atFloatValue(move->arguments[4]), -0.435 / 1.74, 1e-3); // left is counter-clockwise

  robot.land();
  ASSERT_TRUE(eventually([&] { return !flying.inAir(); }));
  EXPECT_EQ(flying.emulator->counters().out_of_sequence, 0u);
}

TEST(RobotArDrone, LeftwardTiltsTheLeftSideDown)
{
  Flying flying;
  vpRobotArDrone robot(flying.grabber, patient());
  robot.open(vpRobotArDrone::Permission::fly);
  robot.takeOff();
  robot.setMaxTranslationVelocity(10);
  vpColVector v(6, 0.0);
  v[1] = 8;
  robot.setVelocity(vpRobot::REFERENCE_FRAME, v);
  ASSERT_TRUE(eventually([&] { return flying.last("PCMD") && flying.last("PCMD")->arguments[0] == "1"; }));
  EXPECT_FLOAT_EQ(atFloatValue(flying.last("PCMD")->arguments[1]), -0.5f);
}

TEST(RobotArDrone, TheWatchdogHoversAndThenLandsWhenCommandsGoStale)
{
  Flying flying;
  vpRobotArDrone::Options options;
  options.laws.hover_after_s = 0.1;
  options.laws.land_after_s = 0.6;
  vpRobotArDrone robot(flying.grabber, options);
  robot.open(vpRobotArDrone::Permission::fly);
  robot.takeOff();
  robot.setVelocity(vpRobot::REFERENCE_FRAME, vpColVector(6, 0.1));
  ASSERT_TRUE(eventually([&] { return flying.last("PCMD") && flying.last("PCMD")->arguments[0] == "0"; })); // hovers
  ASSERT_TRUE(eventually([&] { return flying.last("REF") && !flying.inAir(); }));                           // lands
  const auto commands = flying.emulator->commands();
  EXPECT_TRUE(std::any_of(commands.begin(), commands.end(), [](const AtCommand &c) {
    return c.name == "REF" && (std::stol(c.arguments[0]) & 1 << 9) != 0;
  }));
  EXPECT_TRUE(eventually([&] { return robot.watchdog() == vpRobotArDrone::Watchdog::idle; }));
}

TEST(RobotArDrone, KeepsTheFlightLaws)
{
  Flying flying;
  vpRobotArDrone::Options options = patient();
  options.laws.least_battery = 0.81; // the emulated drone says 80 per cent
  vpRobotArDrone robot(flying.grabber, options);
  robot.open(vpRobotArDrone::Permission::fly);
  robot.takeOff();
  EXPECT_TRUE(eventually([&] { return robot.brokenLaw() == "battery"; }));
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

TEST(RobotArDrone, RefusesVelocitiesThatAreNone)
{
  Flying flying;
  vpRobotArDrone robot(flying.grabber);
  robot.open(vpRobotArDrone::Permission::fly);
  vpColVector v(6, 0.0);
  v[3] = std::nan("");
  EXPECT_THROW(robot.setVelocity(vpRobot::CAMERA_FRAME, v), vpException);
  EXPECT_THROW(robot.setVelocity(vpRobot::CAMERA_FRAME, vpColVector(4, 0.0)), vpException);
  EXPECT_THROW(robot.setVelocity(vpRobot::JOINT_STATE, vpColVector(6, 0.0)), vpException);
}
