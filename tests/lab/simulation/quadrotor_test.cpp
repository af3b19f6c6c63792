// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "simulation/quadrotor.h"

using namespace bole;

namespace
{
QuadrotorOptions calm()
{
  QuadrotorOptions options;
  options.gust = options.velocity_noise = 0;
  return options;
}

void fly(Quadrotor &body, double seconds)
{
  for (int k = 0; k < std::lround(seconds / 0.0025); ++k)
    body.step(0.0025);
}

QuadrotorCommand hovering()
{
  QuadrotorCommand command;
  command.is_flying = true;
  return command;
}

QuadrotorCommand tilted(double forward, double left)
{
  QuadrotorCommand command = hovering();
  command.is_hovering = false;
  command.tilt = {forward, left};
  return command;
}

/// One that has hovered since it took off.
Quadrotor flying(const QuadrotorOptions &options, double heading = 0)
{
  Quadrotor body(options, {0, 0}, heading, 0);
  body.command(hovering());
  fly(body, 6);
  return body;
}

TEST(Quadrotor, TiltedForLongTheSpeedIsWhereDragBalancesThrust)
{
  const QuadrotorOptions options = calm();
  Quadrotor body = flying(options, 0.5);
  body.command(tilted(0.3, 0));
  fly(body, 40);
  const double speed = 9.81 * std::tan(0.3 * kLargestTilt) / options.drag;
  EXPECT_NEAR(body.measuredVelocity().x(), speed, 0.01 * speed);
  EXPECT_NEAR(std::atan2(body.velocity().y(), body.velocity().x()), 0.5, 1e-6); // along the heading
}

TEST(Quadrotor, HalfTheTiltGivesTheAccelerationMeasuredOnARealDrone)
{
  QuadrotorOptions options = calm();
  options.drag = 0;
  Quadrotor body = flying(options);
  body.command(tilted(0.5, 0));
  fly(body, 2);
  EXPECT_NEAR(body.acceleration().x(), 1.4, 0.05);
}

TEST(Quadrotor, TheTiltKeepsItsLimitButForTheOvershootOfItsDamping)
{
  Quadrotor body = flying(calm());
  const double overshoot = std::exp(-M_PI * kTiltDamping / std::sqrt(1 - kTiltDamping * kTiltDamping));
  double most = 0;
  for (int k = 0; k < 20; ++k) {
    body.command(tilted(k % 2 ? 5 : -5, 5)); // twenty times to and fro, far beyond the limit
    for (int i = 0; i < 400; ++i) {
      body.step(0.0025);
      most = std::max(most, body.tilt());
    }
  }
  EXPECT_LT(most, kLargestTilt * (1 + 2 * overshoot) + 0.005);
  EXPECT_GT(most, 0.9 * kLargestTilt);
}

TEST(Quadrotor, CommandsComeLate)
{
  QuadrotorOptions options = calm();
  options.command_delay = 0.2;
  Quadrotor body = flying(options);
  QuadrotorCommand turn = tilted(0, 0);
  turn.turn = 1;
  const double before = body.pose().R(1, 0);
  body.command(turn);
  fly(body, 0.195);
  EXPECT_EQ(body.pose().R(1, 0), before);
  fly(body, 1);
  EXPECT_NEAR(std::asin(body.pose().R(1, 0)), 1 - kTurnLag, 0.05); // a lag costs its time constant
}

TEST(Quadrotor, GustsHaveTheirStandardDeviationAndTheSameSeedTheSameFlight)
{
  QuadrotorOptions options;
  options.velocity_noise = 0;
  options.hover_gain = options.drag = 0;
  options.gust = 0.2;
  options.gust_time = 0.2;
  Quadrotor one(options, {0, 0}, 0, 0), two(options, {0, 0}, 0, 0);
  one.command(hovering());
  two.command(hovering());
  double squares = 0;
  int count = 0;
  for (int k = 0; k < 80000; ++k) {
    one.step(0.0025);
    two.step(0.0025);
    if (k > 4000 && k % 100 == 0) {
      squares += one.acceleration().head<2>().squaredNorm() / 2;
      ++count;
    }
  }
  EXPECT_NEAR(std::sqrt(squares / count), 0.2, 0.02);
  EXPECT_EQ(one.pose().t, two.pose().t);
}

TEST(Quadrotor, RefusesOptionsOutOfRange)
{
  QuadrotorOptions options;
  options.drag = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Quadrotor(options, {0, 0}, 0, 0), vpException);
}
} // namespace
