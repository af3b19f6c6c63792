// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/motion_filter.h"

#include "geometry/constants.h"
#include "motion/made_flight.h"

#include <functional>
#include <gtest/gtest.h>

namespace bole
{
namespace
{
using Eigen::Vector3d;
using test::MadeFlight;
constexpr double kBegins_s = 5;

MadeFlight noisy()
{
  MadeFlight flight;
  flight.odometry_noise = 0.012;
  flight.force_noise = 0.1;
  flight.points_noise = 0.02;
  return flight;
}

struct Flown
{
  MotionFilter filter;
  double worst_speed = 0;         ///< error of the velocity after the first second [m/s]
  std::vector<double> speed_nees; ///< a degree of freedom
  Pose last_truth;
};

/// \p damage changes a frame before the filter sees it.
Flown fly(
    MadeFlight flight, double duration_s = 8, const std::function<void(Frame &)> &damage = [](Frame &) {})
{
  Flown flown{MotionFilter(forwardCamera()), 0, {}, {}};
  for (std::size_t i = 0; i < static_cast<std::size_t>(duration_s * flight.frame_rate); ++i) {
    Frame frame = flight.frame(i), room;
    const double t = secondsOf(frame.stamp_ns);
    damage(frame);
    flown.filter.expect(frame, room);
    flown.filter.process(frame, flight.seen(i));
    flown.last_truth = flight.truth(t);
    const Vector3d velocity = (flight.truth(t + 1e-3).t - flight.truth(t - 1e-3).t) / 2e-3;
    const Vector3d error = flown.filter.velocity() - velocity;
    if (t <= 1)
      continue;
    flown.worst_speed = std::max(flown.worst_speed, error.norm());
    const Eigen::Matrix3d P = flown.filter.motionCovariance().bottomRightCorner<3, 3>();
    flown.speed_nees.push_back(error.dot(P.ldlt().solve(error)) / 3);
  }
  return flown;
}

bool isLate(const Frame &frame) { return frame.stamp_ns >= MadeFlight::nanoseconds(kBegins_s); }
bool isOver(const Frame &frame) { return frame.stamp_ns >= MadeFlight::nanoseconds(kBegins_s + 1); }

void eachRate(Frame &frame, const std::function<Vector3d(const Vector3d &)> &change)
{
  for (GyroSample &sample : frame.gyro)
    sample.rate = change(sample.rate);
}

std::string textsOf(const MotionFilter &filter)
{
  std::string all;
  for (const SensorVerdict &verdict : filter.verdicts())
    all += verdict.text + "; ";
  return all;
}

TEST(MotionFilter, SensorsThatAgreeRaiseNothingAtAnyRateAndSpeed)
{
  for (const double rate : {5, 10, 30, 50})
    for (const double speed : {0.0, 1.0, 3.0, 6.0}) {
      MadeFlight flight = noisy();
      flight.frame_rate = rate;
      flight.odometry_noise *= std::sqrt(10 / rate);
      flight.speed = speed;
      const Flown flown = fly(flight);
      EXPECT_EQ(textsOf(flown.filter), "") << rate << " Hz, " << speed << " m/s";
      EXPECT_LT(flown.worst_speed, 0.3 + 0.05 * speed) << rate << " Hz, " << speed << " m/s";
    }
}

TEST(MotionFilter, ErrorsAreAsLargeAsTheCovarianceSays)
{
  double sum = 0;
  std::size_t count = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    MadeFlight flight = noisy();
    flight.random.seed(seed);
    flight.force_bias = {0.1, -0.15, 0.1};
    const Flown flown = fly(flight);
    for (const double nees : flown.speed_nees)
      sum += nees;
    count += flown.speed_nees.size();
  }
  EXPECT_LT(sum / double(count), 1.5);
  EXPECT_GT(sum / double(count), 0.1);
}

TEST(MotionFilter, ConstantsOfTheSensorsComeBack)
{
  MadeFlight flight = noisy();
  flight.factor = 1.15;
  const Eigen::Matrix3d bRo = expSo3({0.01, -0.015, 0.06});
  const Vector3d bias(0.02, -0.03, 0.04);
  const Flown flown = fly(flight, 20, [&](Frame &f) {
    eachRate(f, [&](const Vector3d &w) { return Vector3d(w + bias); });
    f.wMb_odometry->R = f.wMb_odometry->R * bRo;
  });
  EXPECT_EQ(textsOf(flown.filter), "");
  EXPECT_LT((flown.filter.gyroBias().mean - bias).norm(), 0.004);
  EXPECT_LT(logSo3(flown.filter.mount().transpose() * bRo).norm(), 0.02);
  EXPECT_NEAR(flown.filter.logScale(), std::log(1.15), 0.05);
}

struct Fault
{
  const char *name;
  std::function<void(Frame &)> damage;
  const char *sensor; ///< that must be named; nullptr: harmless
};

std::vector<Fault> lastingFaults()
{
  return {
      {"sign", [](Frame &f) { eachRate(f, [](const Vector3d &w) { return Vector3d(w.x(), w.y(), -w.z()); }); }, "gyro"},
      {"degrees", [](Frame &f) { eachRate(f, [](const Vector3d &w) { return Vector3d(w / kDegree); }); }, "gyro"},
      {"zero",
       [](Frame &f) {
         if (isLate(f))
           eachRate(f, [](const Vector3d &) { return Vector3d(0, 0, 0); });
       },
       "gyro"},
      {"gyro silent",
       [](Frame &f) {
         if (isLate(f))
           f.gyro.clear();
       },
       "gyro"},
      {"odometry silent",
       [](Frame &f) {
         if (isLate(f))
           f.wMb_odometry.reset();
       },
       "odometry"},
      {"freezes",
       [held = Pose()](Frame &f) mutable {
         if (!isLate(f))
           held = *f.wMb_odometry;
         f.wMb_odometry = held;
       },
       "odometry"},
      {"scatters",
       [](Frame &f) {
         if (isLate(f))
           f.wMb_odometry->t.head<2>() += 0.2 * Eigen::Vector2d(double(f.index % 2), double(f.index % 3) - 1);
       },
       "odometry"},
      {"turned over",
       [](Frame &f) {
         const Eigen::Matrix3d over = expSo3({M_PI, 0, 0});
         *f.wMb_odometry = {over * f.wMb_odometry->R * over, over * f.wMb_odometry->t};
       },
       "odometry"},
      {"jumps",
       [](Frame &f) {
         if (isLate(f))
           f.wMb_odometry->t.y() += 1;
       },
       "odometry"},
  };
}

TEST(MotionFilter, EachFaultIsNamedByItsSensor)
{
  for (const Fault &fault : lastingFaults()) {
    const Flown flown = fly(noisy(), 7, fault.damage);
    ASSERT_FALSE(flown.filter.verdicts().empty()) << fault.name;
    const SensorVerdict &first = flown.filter.verdicts().front();
    EXPECT_EQ(first.sensor, fault.sensor) << fault.name << ": " << first.text;
  }
}

TEST(MotionFilter, WhatIsOverIsBelievedAgainAndHasMovedNothing)
{
  const auto whileItLasts = [](const std::function<void(Frame &)> &change) {
    return [=](Frame &f) {
      if (isLate(f) && !isOver(f))
        change(f);
    };
  };
  const std::vector<Fault> faults = {
      {"odometry off by a metre", whileItLasts([](Frame &f) { f.wMb_odometry->t.x() += 1; }), nullptr},
      {"odometry silent", whileItLasts([](Frame &f) { f.wMb_odometry.reset(); }), nullptr},
      {"a packet off by half a metre now and then", whileItLasts([](Frame &f) {
         if (f.index % 3 == 0)
           f.wMb_odometry->t.y() += 0.5;
       }),
       nullptr},
      {"gyro wild",
       whileItLasts([](Frame &f) { eachRate(f, [](const Vector3d &w) { return Vector3d(w + Vector3d(5, 0, 0)); }); }),
       nullptr},
      {"gyro silent", whileItLasts([](Frame &f) { f.gyro.clear(); }), nullptr},
      {"accelerometer wild", whileItLasts([](Frame &f) {
         for (GyroSample &sample : f.gyro)
           *sample.force += Vector3d(20, 0, 0);
       }),
       nullptr},
      {"all silent", whileItLasts([](Frame &f) {
         f.gyro.clear();
         f.wMb_odometry.reset();
       }),
       nullptr},
  };
  for (const Fault &fault : faults) {
    const Flown flown = fly(noisy(), 8, fault.damage);
    for (std::size_t s = 0; s < kSources; ++s)
      EXPECT_TRUE(flown.filter.believes(static_cast<Source>(s))) << fault.name << ": source " << s;
    const Vector3d velocity = flown.filter.velocity();
    EXPECT_LT((velocity - fly(noisy(), 8).filter.velocity()).norm(), 0.15) << fault.name;
    EXPECT_LT((flown.filter.pose().t - flown.last_truth.t).norm(), 0.8) << fault.name;
    EXPECT_LT(logSo3(flown.filter.pose().R.transpose() * flown.last_truth.R).norm(), 0.05) << fault.name;
  }
}

TEST(MotionFilter, AnOddStampThrowsNothingAway)
{
  for (const double off_s : {-0.09, -0.1, -0.1 + 1e-9, 0.09, 5.0, -5.0}) {
    const Flown flown = fly(noisy(), 8, [&](Frame &f) {
      if (f.index == 50)
        f.stamp_ns += MadeFlight::nanoseconds(off_s);
    });
    EXPECT_TRUE(flown.filter.believes(Source::odometry_step)) << off_s;
    EXPECT_LT((flown.filter.pose().t - flown.last_truth.t).norm(), 0.4) << off_s;
    EXPECT_LT((flown.filter.velocity() - fly(noisy(), 8).filter.velocity()).norm(), 0.15) << off_s;
  }
}

TEST(MotionFilter, AHeightThatWandersIsNoFault)
{
  const Flown flown = fly(
      noisy(), 16, [](Frame &f) { f.wMb_odometry->t.z() += 0.25 * std::sin(2 * M_PI * secondsOf(f.stamp_ns) / 8); });
  EXPECT_EQ(textsOf(flown.filter), "");
  EXPECT_LT(std::abs(flown.filter.pose().t.z() - flown.last_truth.t.z()), 0.25);
}

TEST(MotionFilter, AnAccelerometerThatIsOffCostsNoOdometry)
{
  const Flown flown = fly(noisy(), 12, [](Frame &f) {
    for (GyroSample &sample : f.gyro)
      *sample.force += Vector3d(1.0, 0.5, 0);
  });
  EXPECT_TRUE(flown.filter.believes(Source::odometry_step));
  EXPECT_TRUE(flown.filter.believes(Source::odometry_tilt));
  EXPECT_EQ(textsOf(flown.filter).find("odometry"), std::string::npos) << textsOf(flown.filter);
}
} // namespace
} // namespace bole
