// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/made_flight.h"
#include "support/test.h"

#include "motion/inertial_scale.h"
#include "motion/path_scale.h"

using namespace bole;

namespace
{
using test::MadeFlight;

constexpr double kWide = 10; // of the log of the scale: nothing is expected
constexpr std::size_t kFrames = 120, kLongFlight = 600;

/// The path of a flight as a smoother may hold it.
struct MadePath
{
  double factor = 1, sigma = 0, walk = 0; ///< of horizontal lengths; white [m]; a frame [m]
  double tilt = 0;                        ///< of its attitude, for each m/s^2 to the left [rad]

  std::vector<Pose> poses(MadeFlight &flight, std::size_t frames = kFrames) const
  {
    std::vector<Pose> path;
    Eigen::Vector3d off = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < frames; ++i) {
      const double t = 0.1 * static_cast<double>(i), h = 0.01;
      Pose pose = flight.truth(t);
      const double left = (flight.truth(t + h).t - 2 * pose.t + flight.truth(t - h).t).y() / (h * h);
      pose.R = expSo3({tilt * left, 0, 0}) * pose.R;
      pose.t.head<2>() *= factor;
      off += walk * flight.white();
      pose.t += off + sigma * flight.white();
      path.push_back(pose);
    }
    return path;
  }
};

std::optional<LogScale> measure(MadeFlight flight, const MadePath &made, double prior_sigma = kWide,
                                std::size_t silent_from = kFrames, std::size_t silent_to = kFrames)
{
  PathScale scale;
  for (std::size_t i = 0; i < kFrames; ++i) {
    Frame frame = flight.frame(i);
    if (i >= silent_from && i < silent_to)
      frame.gyro.clear();
    scale.add(frame);
  }
  const std::vector<Pose> path = made.poses(flight);
  const auto at = [&path](std::size_t i) { return path[i]; };
  return scale.measure(at, prior_sigma);
}

MadeFlight noisy()
{
  MadeFlight flight;
  flight.force_noise = 0.1;
  flight.force_bias = {0.05, -0.08, 0.04};
  return flight;
}

InertialScale fly(double duration, MadeFlight flight)
{
  InertialScale inertial(forwardCamera());
  for (std::size_t i = 0; i < static_cast<std::size_t>(10 * duration); ++i)
    inertial.process(flight.frame(i), flight.seen(i));
  return inertial;
}
} // namespace

TEST(PathScale, AnExactPathGivesItsScale)
{
  for (const double factor : {0.8, 0.97, 1.05, 1.3}) {
    const auto scale = measure({}, {factor});
    ASSERT_TRUE(scale);
    EXPECT_NEAR(scale->mean, std::log(factor), 0.004) << factor;
  }
}

TEST(PathScale, NoiseAndBiasStayWithinThreeStandardDeviations)
{
  double squared = 0;
  constexpr int kFlights = 10;
  for (int seed = 1; seed <= kFlights; ++seed) {
    MadeFlight flight = noisy();
    flight.random.seed(static_cast<unsigned>(seed));
    const auto scale = measure(flight, {1.03, 0.008, 0.0038});
    ASSERT_TRUE(scale);
    EXPECT_LT(scale->sigma, 0.015);
    const double z = (scale->mean - std::log(1.03)) / scale->sigma;
    EXPECT_LT(std::abs(z), 3) << seed;
    squared += z * z / kFlights;
  }
  EXPECT_LT(squared, 2);
}

TEST(PathScale, ATiltOfThePathIsNotBelieved)
{
  MadePath leaning;
  leaning.tilt = 0.05 / 9.81; // gravity through it: 5 % of each acceleration
  const auto scale = measure(noisy(), leaning);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->mean, 0, 0.015);
}

TEST(PathScale, ASteadyFlightLeavesTheScaleUnknown)
{
  MadeFlight flight = noisy();
  flight.sway = 0;
  const auto scale = measure(flight, {1, 0.008, 0.0038}, 0.03);
  ASSERT_TRUE(scale);
  EXPECT_GT(scale->sigma, 0.02);
}

/// Its acceleration is constant in the body, as a bias is.
TEST(PathScale, ASteadyCurveLeavesTheScaleUnknown)
{
  for (const MadePath &made : {MadePath{1}, MadePath{1, 0.008, 0.0063}}) {
    MadeFlight flight = noisy();
    flight.radius = 6.4;
    PathScale scale;
    for (std::size_t i = 0; i < kLongFlight; ++i)
      scale.add(flight.frame(i));
    const std::vector<Pose> path = made.poses(flight, kLongFlight);
    const auto measured = scale.measure([&path](std::size_t i) { return path[i]; }, 0.03);
    ASSERT_TRUE(measured);
    EXPECT_FALSE(measured->contradicts_prior);
    EXPECT_NEAR(measured->mean, 0, 0.01);
    EXPECT_GT(measured->sigma, 0.025);
  }
}

TEST(PathScale, AnAccelerometerThatRepeatsOneValueIsNotBelieved)
{
  MadeFlight flight;
  flight.has_constant_force = true;
  EXPECT_FALSE(measure(flight, {}));
}

TEST(PathScale, APathAThirdTooLongContradictsWhatWasExpected)
{
  const auto scale = measure({}, {1.33}, 0.03);
  ASSERT_TRUE(scale);
  EXPECT_TRUE(scale->contradicts_prior);
  EXPECT_NEAR(scale->mean, std::log(1.33), 0.005);
}

TEST(PathScale, WhatABiasThatChangesSaidIsTakenBack)
{
  MadeFlight flight = noisy();
  PathScale forgetful, credulous;
  for (std::size_t i = 0; i < kFrames; ++i) {
    if (i == 60)
      flight.force_bias += Eigen::Vector3d(1, -1, 0);
    const Frame frame = flight.frame(i);
    forgetful.add(frame);
    credulous.add(frame);
    if (i == 75)
      forgetful.forget(2);
  }
  const std::vector<Pose> path = MadePath().poses(flight);
  const auto at = [&path](std::size_t i) { return path[i]; };
  const auto scale = forgetful.measure(at, kWide), wrong = credulous.measure(at, kWide);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->mean, 0, 0.02);
  EXPECT_TRUE(!wrong || std::abs(wrong->mean) > 0.02);
}

TEST(PathScale, BeginsAnewAfterSamplesThatAreMissing)
{
  const auto scale = measure({}, {1.05}, kWide, 50, 60);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->mean, std::log(1.05), 0.006);
}
TEST(InertialScale, ExactSensorsGiveTheScaleOfTheOdometry)
{
  for (const double factor : {0.8, 0.97, 1.05, 1.3}) {
    MadeFlight made;
    made.factor = factor;
    const auto scale = fly(14, made).scale(kWide);
    ASSERT_TRUE(scale);
    EXPECT_NEAR(scale->mean, std::log(factor), 0.006) << factor;
  }
}

TEST(InertialScale, NoiseAndBiasStayWithinThreeStandardDeviations)
{
  MadeFlight made;
  made.odometry_noise = 0.012;
  made.force_noise = 0.1;
  made.force_bias = {0.05, -0.08, 0.04};
  const auto scale = fly(12, made).scale(kWide);
  ASSERT_TRUE(scale);
  EXPECT_LT(scale->sigma, 0.03);
  EXPECT_LT(std::abs(scale->mean - std::log(made.factor)), 3 * scale->sigma);
}

TEST(InertialScale, NoiseOfDirectionsMakesNothingShorter)
{
  double sum = 0;
  constexpr int kFlights = 8;
  for (unsigned seed = 1; seed <= kFlights; ++seed) {
    MadeFlight made;
    made.radius = 6.4;
    made.random.seed(seed);
    made.odometry_noise = 0.012;
    made.force_noise = 0.1;
    made.points_noise = 0.01;
    const auto scale = fly(60, made).scale(kWide);
    ASSERT_TRUE(scale);
    sum += scale->mean;
  }
  EXPECT_NEAR(sum / kFlights, 0, 0.012);
}

TEST(InertialScale, IsUnknownWherePointsTellNoDirection)
{
  MadeFlight made;
  made.radius = 6.4;
  InertialScale inertial(forwardCamera());
  for (std::size_t i = 0; i < 200; ++i)
    inertial.process(made.frame(i), {});
  EXPECT_FALSE(inertial.scale(0.03));
}

TEST(InertialScale, ARotationThatPointsTookForATranslationIsUndoneByTheGyro)
{
  MadeFlight made;
  made.sway = 0.6;
  made.odometry_noise = 0.012;
  made.force_noise = 0.1;
  made.points_turn = 0.01;
  made.points_slip = 20;
  const auto scale = fly(12, made).scale(kWide);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->mean, 0, 0.02);
  EXPECT_LT(scale->sigma, 0.018);
}

TEST(InertialScale, ASteadyFlightLeavesTheScaleUnknown)
{
  MadeFlight made;
  made.sway = 0;
  made.odometry_noise = 0.012;
  made.force_noise = 0.1;
  const auto scale = fly(12, made).scale(0.03);
  ASSERT_TRUE(scale);
  EXPECT_GT(scale->sigma, 0.02);
}

TEST(InertialScale, AnAccelerometerThatRepeatsOneValueIsNotBelieved)
{
  MadeFlight made;
  made.has_constant_force = true;
  EXPECT_FALSE(fly(6, made).scale(0.03));
}

TEST(InertialScale, ABiasThatChangesInFlightTellsNoWrongScale)
{
  for (const Eigen::Vector3d &bias : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1.5, 0)}) {
    MadeFlight made;
    made.odometry_noise = 0.012;
    made.force_noise = 0.1;
    InertialScale inertial(forwardCamera());
    int begun_anew = 0;
    for (std::size_t i = 0; i < 120; ++i) {
      made.force_bias = i < 50 ? Eigen::Vector3d(0, 0, 0) : bias;
      inertial.process(made.frame(i), made.seen(i));
      begun_anew += inertial.hasBegunAnew();
      EXPECT_TRUE(i >= 50 || begun_anew == 0) << i;
    }
    EXPECT_GT(begun_anew, 0);
    const auto scale = inertial.scale(0.03);
    ASSERT_TRUE(scale);
    EXPECT_LT(std::abs(scale->mean), 3 * scale->sigma) << bias.transpose();
    EXPECT_FALSE(scale->contradicts_prior);
  }
}

TEST(InertialScale, AnOdometryAThirdTooLongContradictsWhatWasExpected)
{
  MadeFlight made;
  made.factor = 1.33;
  const auto scale = fly(12, made).scale(0.03);
  ASSERT_TRUE(scale);
  EXPECT_TRUE(scale->contradicts_prior);
  EXPECT_NEAR(scale->mean, std::log(1.33), 0.02);
}

TEST(InertialScale, TwoSecondsWithoutOdometryAreBridgedWithinThreeStandardDeviations)
{
  MadeFlight made;
  made.odometry_noise = 0.012;
  made.force_noise = 0.1;
  made.force_bias = {0.05, -0.08, 0.04};
  made.factor = 1.1;
  InertialScale inertial(forwardCamera());
  Eigen::Vector3d error = Eigen::Vector3d::Zero();
  double variance = 0;
  int bridged = 0;
  for (std::size_t i = 0; i < 100; ++i) {
    Frame frame = made.frame(i);
    if (i >= 80) {
      frame.wMb_odometry.reset();
      const double from = 0.1 * static_cast<double>(i - 1), to = 0.1 * static_cast<double>(i);
      const auto step = inertial.stepTo(frame, MadeFlight::nanoseconds(from));
      ASSERT_TRUE(step) << i;
      const Pose a = made.truth(from), b = made.truth(to);
      const Eigen::Vector3d moved = (b.t - a.t).cwiseProduct(Eigen::Vector3d(made.factor, made.factor, 1));
      error += a.R * step->moved - moved;
      variance += step->sigma * step->sigma;
      ++bridged;
    }
    inertial.process(frame, made.seen(i));
  }
  EXPECT_EQ(bridged, 20);
  EXPECT_LT(error.norm(), 3 * std::sqrt(3 * variance)) << error.transpose() << " +- " << std::sqrt(variance);
  EXPECT_LT(error.norm(), 0.3) << error.transpose(); // of two metres
}
