// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/made_flight.h"
#include "support/test.h"

#include "motion/inertial_scale.h"

using namespace bole;

namespace
{
using test::MadeFlight;
using test::noisyFlight;

constexpr double kWide = 10; // of the log of the scale: nothing is expected

InertialScale fly(double duration, MadeFlight flight)
{
  InertialScale inertial(forwardCamera());
  for (std::size_t i = 0; i < static_cast<std::size_t>(10 * duration); ++i)
    inertial.process(flight.frame(i), flight.seen(i));
  return inertial;
}
} // namespace

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
  MadeFlight made = noisyFlight();
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
    MadeFlight made = noisyFlight();
    made.radius = 6.4;
    made.random.seed(seed);
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

TEST(InertialScale, IsKnownWherePointsTellTheDirectionInOneWindowOfThree)
{
  MadeFlight made = noisyFlight();
  made.factor = 0.97;
  InertialScale inertial(forwardCamera());
  for (std::size_t i = 0; i < 200; ++i)
    inertial.process(made.frame(i), i / 10 % 3 == 0 ? made.seen(i) : std::vector<RelativeMotion>());
  const auto scale = inertial.scale(kWide);
  ASSERT_TRUE(scale);
  EXPECT_LT(std::abs(scale->mean - std::log(made.factor)), 3 * scale->sigma);
  EXPECT_LT(scale->sigma, 0.03);
}

TEST(InertialScale, ARotationThatPointsTookForATranslationIsUndoneByTheGyro)
{
  MadeFlight made = noisyFlight();
  made.sway = 0.6;
  made.points_turn = 0.01;
  made.points_slip = 20;
  const auto scale = fly(12, made).scale(kWide);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->mean, 0, 0.02);
  EXPECT_LT(scale->sigma, 0.018);
}

TEST(InertialScale, ASteadyFlightLeavesTheScaleUnknown)
{
  MadeFlight made = noisyFlight();
  made.sway = 0;
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
    MadeFlight made = noisyFlight();
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
  }
}

TEST(InertialScale, AnOdometryAThirdTooLongContradictsWhatWasExpected)
{
  MadeFlight made;
  made.factor = 1.33;
  const auto scale = fly(12, made).scale(0.03);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->mean, std::log(1.33), 0.02);
}

TEST(InertialScale, TwoSecondsWithoutOdometryAreBridgedWithinThreeStandardDeviations)
{
  MadeFlight made = noisyFlight();
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
      const auto step = inertial.stepTo(frame, nsOf(from));
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
