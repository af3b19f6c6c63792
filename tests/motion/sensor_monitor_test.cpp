// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/made_flight.h"
#include "support/test.h"

#include "motion/sensor_monitor.h"

using namespace bole;

namespace
{
using Eigen::Vector3d;
using test::isLate;
using test::kBegins_s;
using test::late;
using test::MadeFlight;
using test::rates;

/// \p damage changes a frame before the monitor sees it.
SensorMonitor fly(const test::Damage &damage, double rate = 10, double duration_s = 8, double sway = 1.2)
{
  MadeFlight flight = test::noisyFlight();
  flight.sway = sway;
  flight.frame_rate = rate;
  SensorMonitor monitor(forwardCamera());
  for (std::size_t i = 0; i < static_cast<std::size_t>(duration_s * rate); ++i) {
    Frame frame = flight.frame(i);
    damage(frame);
    monitor.process(frame, flight.seen(i));
  }
  return monitor;
}

struct Fault
{
  const char *name;
  test::Damage damage;
  Sensor sensor;
  const char *kind;
};

std::vector<Fault> faults()
{
  const auto pitched = [](double angle) { return expSo3({0, angle, 0}); };
  return {
      {"bias", rates([](Vector3d &w) { w.z() += 0.05; }), Sensor::gyro, "bias"},
      {"sign", rates([](Vector3d &w) { w.z() *= -1; }), Sensor::gyro, "rotation"},
      {"swapped", rates([](Vector3d &w) { std::swap(w.x(), w.y()); }), Sensor::gyro,
       nullptr}, // in a flight that hardly rolls it looks like a bias
      {"zero", late(rates([](Vector3d &w) { w.setZero(); })), Sensor::gyro, nullptr},
      {"silent", late([](Frame &f) { f.gyro.clear(); }), Sensor::gyro, "ended"},
      {"ends", late([](Frame &f) { f.wMb_odometry.reset(); }), Sensor::odometry, "ended"},
      {"jumps", late([](Frame &f) { f.wMb_odometry->t.y() += 1; }), Sensor::odometry, "jump"},
      {"counts from the sea", [](Frame &f) { f.wMb_odometry->t.z() += 500; }, Sensor::odometry, "height"},
      {"counts down", [](Frame &f) { f.wMb_odometry->t.z() *= -10; }, Sensor::odometry, "height"},
      {"freezes",
       [held = Pose()](Frame &f) mutable {
         if (!isLate(f))
           held = *f.wMb_odometry;
         f.wMb_odometry = held;
       },
       Sensor::odometry, "stuck"},
      {"leans", [=](Frame &f) { f.wMb_odometry->R = f.wMb_odometry->R * pitched(0.17); }, Sensor::odometry, nullptr},
      {"askew",
       [](Frame &f) {
         f.wMb_odometry->R = f.wMb_odometry->R * expSo3({0, 0, 0.2});
       },
       Sensor::odometry, "direction"},
      {"turned over",
       [](Frame &f) {
         const Eigen::Matrix3d over = expSo3({M_PI, 0, 0});
         *f.wMb_odometry = {over * f.wMb_odometry->R * over, over * f.wMb_odometry->t};
       },
       Sensor::odometry, nullptr},
  };
}
} // namespace

TEST(SensorMonitor, SensorsThatAgreeRaiseNothingAtAnyRate)
{
  for (const double rate : {5, 10, 20, 30, 50})
    for (const double sway : {1.2, 5.0}) { // the latter by 5.5 m/s^2 from side to side, more than half of gravity
      const SensorMonitor monitor = fly([](Frame &) {}, rate, 12, sway);
      EXPECT_TRUE(monitor.verdicts().empty()) << rate << " Hz: " << monitor.verdicts().front().text;
    }
}

TEST(SensorMonitor, AnAccelerometerThatIsOffCostsTheOdometryNothing)
{
  const auto off = [](const Vector3d &bias, double until_s) {
    return [bias, until_s](Frame &f) {
      for (GyroSample &sample : f.gyro)
        if (sample.stamp_ns < nsOf(until_s))
          *sample.force += bias;
    };
  };
  for (const Vector3d &bias : {Vector3d(1, 0.5, 0), Vector3d(0, -2, 0), Vector3d(0, 0, 1.5)}) {
    const SensorMonitor monitor = fly(off(bias, 100));
    ASSERT_EQ(monitor.verdicts().size(), 1u) << bias.transpose();
    EXPECT_EQ(monitor.verdicts()[0].sensor, "accelerometer") << monitor.verdicts()[0].text;
    EXPECT_TRUE(monitor.trusts(Sensor::odometry) && monitor.trusts(Sensor::gyro));
    Frame scratch;
    const Frame frame = MadeFlight().frame(5);
    const Frame &trusted = monitor.trusted(frame, scratch);
    EXPECT_TRUE(trusted.wMb_odometry);
    ASSERT_FALSE(trusted.gyro.empty());
    EXPECT_FALSE(trusted.gyro.front().force);
  }
  const SensorMonitor after = fly(off({0, -2, 0}, 6), 10, 14);
  EXPECT_TRUE(after.trusts(Sensor::accelerometer));
  ASSERT_EQ(after.verdicts().size(), 1u);
  EXPECT_NE(after.verdicts()[0].text.find(" until "), std::string::npos) << after.verdicts()[0].text;
}

TEST(SensorMonitor, TwoSecondsWithoutAPictureRaiseNothing)
{
  MadeFlight flight;
  SensorMonitor monitor(forwardCamera());
  std::vector<GyroSample> waiting;
  for (std::size_t i = 0; i < 120; ++i) {
    Frame frame = flight.frame(i);
    waiting.insert(waiting.end(), frame.gyro.begin(), frame.gyro.end());
    if (i >= 50 && i < 70)
      continue;
    frame.gyro.swap(waiting);
    waiting.clear();
    monitor.process(frame, i < 50 || i >= 73 ? flight.seen(i) : std::vector<RelativeMotion>());
    EXPECT_TRUE(monitor.trusts(Sensor::odometry) && monitor.trusts(Sensor::accelerometer)) << i;
  }
  EXPECT_TRUE(monitor.verdicts().empty()) << monitor.verdicts().front().text;
}

TEST(SensorMonitor, AGyroThatLosesSamplesIsNamedAndStaysInUse)
{
  const auto keep = [](const std::function<bool(std::size_t)> &isKept) {
    return [isKept, count = std::size_t(0)](Frame &f) mutable {
      std::vector<GyroSample> kept;
      for (const GyroSample &sample : f.gyro)
        if (isKept(count++))
          kept.push_back(sample);
      f.gyro.swap(kept);
    };
  };
  std::mt19937 random(7);
  std::bernoulli_distribution tenth(0.1);
  const SensorMonitor holes = fly(keep([&](std::size_t i) { return i < 500 || tenth(random); }));
  ASSERT_FALSE(holes.verdicts().empty());
  const SensorVerdict &verdict = holes.verdicts().front();
  EXPECT_EQ(verdict.sensor + " " + verdict.kind, "gyro holes") << verdict.text;
  EXPECT_TRUE(holes.trusts(Sensor::gyro) && holes.trusts(Sensor::odometry));
  for (const std::size_t every : {2, 5}) { // a slower one
    const SensorMonitor slow = fly(keep([every](std::size_t i) { return i % every == 1; }));
    EXPECT_TRUE(slow.verdicts().empty()) << every << ": " << slow.verdicts().front().text;
  }
  const SensorMonitor some = fly(keep([](std::size_t i) { return i % 10 != 0; })); // a sample now and then
  EXPECT_TRUE(some.verdicts().empty()) << some.verdicts().front().text;
}

TEST(SensorMonitor, AnAccelerometerThatFeelsNoGravityIsNotTheOdometrysFault)
{
  const SensorMonitor monitor = fly([](Frame &f) {
    for (GyroSample &sample : f.gyro)
      *sample.force *= isLate(f) ? 1e-3 : 1;
  });
  EXPECT_TRUE(monitor.trusts(Sensor::odometry));
  EXPECT_FALSE(monitor.trusts(Sensor::accelerometer));
}

TEST(SensorMonitor, OneOddStampCostsTheOdometryNothingFromTheSecondFrameOn)
{
  for (const std::int64_t early_ns : {60'000'000, 95'000'000, 99'999'999}) {
    const SensorMonitor monitor = fly([early_ns](Frame &f) { f.stamp_ns -= f.index == 60 ? early_ns : 0; });
    EXPECT_TRUE(monitor.trustsNow(Sensor::odometry)) << early_ns;
    for (const SensorVerdict &verdict : monitor.verdicts())
      EXPECT_NE(verdict.kind, "noise") << verdict.text;
  }
}

TEST(SensorMonitor, APoseThatIsOffAndComesBackIsTwoJumpsOfWhichNoneIsBelieved)
{
  MadeFlight flight;
  SensorMonitor monitor(forwardCamera());
  for (std::size_t i = 0; i < 60; ++i) {
    Frame frame = flight.frame(i);
    frame.wMb_odometry->t.y() += i >= 40 && i < 42 ? 1 : 0;
    monitor.process(frame, flight.seen(i));
    EXPECT_EQ(monitor.trustsNow(Sensor::odometry), i != 40 && i != 42) << i;
  }
}

TEST(SensorMonitor, EachFaultIsNamedWithItsSensorWhichIsLeftOut)
{
  for (const Fault &fault : faults()) {
    const SensorMonitor monitor = fly(fault.damage);
    ASSERT_FALSE(monitor.verdicts().empty()) << fault.name;
    const SensorVerdict &verdict = monitor.verdicts().front();
    EXPECT_EQ(verdict.sensor, toString(fault.sensor)) << fault.name << ": " << verdict.text;
    if (fault.kind != nullptr) {
      EXPECT_EQ(verdict.kind, fault.kind) << fault.name << ": " << verdict.text;
    }
    if (const std::string name = fault.name;
        name == "zero" || name == "silent" || name == "ends" || name == "freezes") {
      EXPECT_NEAR(verdict.since_s, kBegins_s, 0.5) << name;
    }
    EXPECT_TRUE(monitor.trusts(Sensor::images)) << fault.name;
    EXPECT_TRUE(monitor.trusts(fault.sensor == Sensor::gyro ? Sensor::odometry : Sensor::gyro)) << fault.name;
    if (fault.sensor == Sensor::gyro) {
      const Frame frame = MadeFlight().frame(5);
      Frame scratch;
      const Frame &trusted = monitor.trusted(frame, scratch);
      EXPECT_TRUE(trusted.gyro.empty() && trusted.wMb_odometry) << fault.name;
    }
  }
}

TEST(SensorMonitor, ASensorThatAgreesAgainAfterASilenceIsTrustedAgain)
{
  const auto isSilent = [](const Frame &frame) { return frame.stamp_ns >= nsOf(3) && frame.stamp_ns < nsOf(5); };
  const SensorMonitor gyro = fly([&](Frame &f) {
    if (isSilent(f))
      f.gyro.clear();
  });
  const SensorMonitor odometry = fly([&](Frame &f) {
    if (isSilent(f))
      f.wMb_odometry.reset();
  });
  const SensorMonitor held = fly([&, last = Pose()](Frame &f) mutable {
    if (!isSilent(f))
      last = *f.wMb_odometry;
    f.wMb_odometry = last;
  });
  for (const SensorMonitor *monitor : {&gyro, &odometry, &held}) {
    ASSERT_EQ(monitor->verdicts().size(), 1u);
    EXPECT_NE(monitor->verdicts().front().text.find("until"), std::string::npos) << monitor->verdicts().front().text;
    EXPECT_TRUE(monitor->trusts(Sensor::gyro) && monitor->trusts(Sensor::odometry));
  }
}

/// A flight in which each image until \p until_s was taken at another time than its stamp says, by normal errors and by
/// a constant.
SensorMonitor flyByWrongStamps(double sigma_s, double late_s, double duration_s = 8, double until_s = 1e3)
{
  MadeFlight flight;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, 1);
  std::vector<std::int64_t> stamps;
  SensorMonitor monitor(forwardCamera());
  for (std::size_t i = 0; i < static_cast<std::size_t>(10 * duration_s); ++i) {
    Frame frame = flight.frame(i);
    std::vector<RelativeMotion> seen = flight.seen(i);
    if (0.1 * double(i) >= until_s)
      sigma_s = late_s = 0;
    stamps.push_back(frame.stamp_ns + nsOf(late_s + std::clamp(sigma_s * normal(random), -0.04, 0.04)));
    frame.stamp_ns = stamps.back();
    for (RelativeMotion &motion : seen) {
      motion.a_ns = stamps[i - 3];
      motion.b_ns = stamps[i];
    }
    monitor.process(frame, seen);
  }
  return monitor;
}

/// A second of rates that no drone has.
TEST(SensorMonitor, AGyroThatWasWrongForAMomentIsTrustedAgainAndOneThatStaysWrongIsNot)
{
  const auto spiked = [](Frame &f) {
    if (isLate(f) && f.stamp_ns < nsOf(kBegins_s + 1))
      rates([](Vector3d &w) { w.z() += 30; })(f);
  };
  const SensorMonitor during = fly(spiked, 10, kBegins_s + 1);
  EXPECT_FALSE(during.trusts(Sensor::gyro));
  const SensorMonitor after = fly(spiked, 10, 14);
  ASSERT_EQ(after.verdicts().size(), 1u);
  EXPECT_EQ(after.verdicts()[0].kind, "rotation");
  EXPECT_NEAR(after.verdicts()[0].since_s, kBegins_s, 0.3);
  EXPECT_NE(after.verdicts()[0].text.find(" until "), std::string::npos) << after.verdicts()[0].text;
  EXPECT_TRUE(after.trusts(Sensor::gyro));
  for (const Fault &fault : faults()) {
    if (fault.sensor == Sensor::gyro) {
      EXPECT_FALSE(fly(fault.damage, 10, 30).trusts(Sensor::gyro)) << fault.name;
    }
  }
}

TEST(SensorMonitor, StampsThatScatterAreNamedAndLeaveTheGyroOut)
{
  const SensorMonitor monitor = flyByWrongStamps(0.015, 0);
  ASSERT_FALSE(monitor.verdicts().empty());
  EXPECT_EQ(monitor.verdicts().front().kind, "stamps") << monitor.verdicts().front().text;
  EXPECT_LT(monitor.verdicts().front().since_s, 2);
  EXPECT_FALSE(monitor.trusts(Sensor::gyro));
  EXPECT_TRUE(monitor.trusts(Sensor::odometry) && monitor.trusts(Sensor::images));
  EXPECT_FALSE(flyByWrongStamps(0.015, 0, 30).trusts(Sensor::gyro));
  const SensorMonitor held = flyByWrongStamps(0.015, 0, 14, 5);
  EXPECT_TRUE(held.trusts(Sensor::gyro));
  EXPECT_EQ(held.verdicts().size(), 1u) << "named once";
}

TEST(SensorMonitor, StampsThatHoldOrAreLateAllAlikeDoNotScatter)
{
  for (const double late_s : {0.0, 0.03}) {
    const SensorMonitor monitor = flyByWrongStamps(0.0003, late_s);
    for (const SensorVerdict &verdict : monitor.verdicts())
      EXPECT_NE(verdict.kind, "stamps") << late_s << ": " << verdict.text;
  }
}

TEST(SensorMonitor, AHeldPoseIsNoStepFromItsFirstFrameOn)
{
  MadeFlight flight;
  SensorMonitor monitor(forwardCamera());
  Pose last;
  for (std::size_t i = 0; i < 40; ++i) {
    Frame frame = flight.frame(i);
    const bool is_held = i == 30 || i == 31;
    if (is_held)
      frame.wMb_odometry = last;
    last = *frame.wMb_odometry;
    monitor.process(frame, flight.seen(i));
    EXPECT_EQ(monitor.trustsNow(Sensor::odometry), i < 30 || i > 32) << i; // the step after it makes up for the pause
  }
}

TEST(SensorMonitor, AFrameThatTwoSensorsContradictIsLeftOutAtOnce)
{
  MadeFlight flight;
  SensorMonitor monitor(forwardCamera());
  for (std::size_t i = 0; i < 31; ++i) {
    Frame frame = flight.frame(i);
    if (i == 30)
      rates([](Vector3d &w) { w.z() += 1; })(frame);
    monitor.process(frame, flight.seen(i));
    EXPECT_EQ(monitor.trustsNow(Sensor::gyro), i < 30) << i;
    Frame scratch;
    EXPECT_EQ(monitor.trusted(frame, scratch).gyro.empty(), i == 0 || i == 30) << i;
  }
  EXPECT_TRUE(monitor.verdicts().empty());
  EXPECT_TRUE(monitor.trusts(Sensor::gyro));
}

/// What is left of each frame before its points are looked for, which a turn that is far off would lead astray.
TEST(SensorMonitor, ATurnThatCannotBeIsLeftOutBeforeThePointsAreLookedFor)
{
  constexpr std::size_t kFrom = 30, kTo = 40;
  const auto leftOut = [](const std::function<void(Frame &)> &damage) {
    MadeFlight flight;
    SensorMonitor monitor(forwardCamera());
    std::pair<int, int> without; // gyro, odometry
    for (std::size_t i = 0; i < kTo; ++i) {
      Frame frame = flight.frame(i), scratch;
      if (i >= kFrom)
        damage(frame);
      const Frame &looked_at = monitor.withoutRejectedSensors(frame, scratch);
      without.first += i > 0 && looked_at.gyro.empty();
      without.second += !looked_at.wMb_odometry;
      monitor.process(frame, flight.seen(i));
    }
    return without;
  };
  const auto turned = [](Frame &frame, double angle) {
    frame.wMb_odometry->R = Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix() * frame.wMb_odometry->R;
  };
  EXPECT_EQ(leftOut([](Frame &) {}), std::make_pair(0, 0));
  const auto wild = rates([](Vector3d &w) { w.x() += 30; });
  EXPECT_EQ(leftOut(wild), std::make_pair(10, 0));
  EXPECT_EQ(leftOut([&](Frame &f) { turned(f, 0.5); }), std::make_pair(0, 1)) << "a heading that is corrected once";
}

TEST(SensorMonitor, WithoutAnOdometryNoBodyBeginsToTurnAsFastAsAWildGyroSays)
{
  MadeFlight flight;
  SensorMonitor monitor(forwardCamera());
  for (std::size_t i = 0; i < 60; ++i) {
    Frame frame = flight.frame(i), scratch;
    frame.wMb_odometry.reset();
    const bool is_wild = i >= 30 && i < 40;
    if (is_wild)
      rates([](Vector3d &w) { w.x() += 30; })(frame);
    EXPECT_EQ(monitor.withoutRejectedSensors(frame, scratch).gyro.empty(),
              i == 0 || is_wild || !monitor.trusts(Sensor::gyro))
        << i;
    monitor.process(frame, flight.seen(i));
    EXPECT_EQ(monitor.trustsNow(Sensor::gyro), i < 30 || (!is_wild && monitor.trusts(Sensor::gyro))) << i;
  }
  ASSERT_EQ(monitor.verdicts().size(), 1u);
  EXPECT_EQ(monitor.verdicts()[0].sensor, "gyro");
}

TEST(SensorMonitor, AnOdometryThatGoesOnJumpingIsNamedInAFewLinesAndLeftOut)
{
  const SensorMonitor monitor = fly([](Frame &f) {
    f.wMb_odometry->t.x() *= 100; // in centimetres
  });
  EXPECT_FALSE(monitor.trusts(Sensor::odometry));
  EXPECT_LE(monitor.verdicts().size(), 4u);
  EXPECT_EQ(monitor.verdicts().back().kind, "noise") << monitor.verdicts().back().text;
  const SensorMonitor once = fly([](Frame &f) { f.wMb_odometry->t.y() += isLate(f) ? 1 : 0; });
  EXPECT_TRUE(once.trusts(Sensor::odometry));
}

TEST(SensorMonitor, ImagesThatContradictBothOthersAreTheLiar)
{
  MadeFlight flight;
  SensorMonitor monitor(forwardCamera());
  for (std::size_t i = 0; i < 80; ++i) {
    std::vector<RelativeMotion> seen = flight.seen(i);
    for (RelativeMotion &motion : seen)
      motion.points.aRb = motion.points.aRb * expSo3({0, 0.08, 0});
    monitor.process(flight.frame(i), seen);
  }
  EXPECT_FALSE(monitor.trusts(Sensor::images));
  EXPECT_TRUE(monitor.trusts(Sensor::gyro));
  EXPECT_TRUE(monitor.trusts(Sensor::odometry));
}

/// A scene of few points in one plane, in a quick sway: 1.8 degrees off and surer than that, for eight frames. The
/// odometry is too coarse to contradict any one of them.
TEST(SensorMonitor, PointsThatErrForAFewFramesAreNotTheGyrosFault)
{
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    MadeFlight flight;
    flight.random.seed(seed);
    SensorMonitor monitor(forwardCamera());
    for (std::size_t i = 0; i < 80; ++i) {
      Frame frame = flight.frame(i);
      frame.wMb_odometry->R = frame.wMb_odometry->R * expSo3(0.005 * flight.white());
      std::vector<RelativeMotion> seen = flight.seen(i);
      const bool errs = i >= 40 && i < 48;
      if (errs) {
        seen[0].points.aRb = seen[0].points.aRb * expSo3({-0.022, 0.007, -0.021});
        seen[0].points.covariance.topLeftCorner<3, 3>() = std::pow(0.0037, 2) * Eigen::Matrix3d::Identity();
      }
      monitor.process(frame, seen);
      EXPECT_TRUE(monitor.trusts(Sensor::gyro)) << seed << ", frame " << i;
      if (errs && i > 40) { // one frame alone may be undecided
        EXPECT_TRUE(monitor.trustsNow(Sensor::gyro)) << seed << ", frame " << i;
        EXPECT_FALSE(monitor.trustsNow(Sensor::images)) << seed << ", frame " << i;
      }
    }
    EXPECT_TRUE(monitor.verdicts().empty()) << monitor.verdicts().front().text;
  }
}
