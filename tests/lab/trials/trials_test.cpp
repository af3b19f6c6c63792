// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "faults/fault.h"
#include "simulation/random.h"
#include "support/text.h"
#include "support/units.h"
#include "trials/closed_loop.h"
#include "trials/servo_trial.h"

using namespace bole;

namespace
{
TEST(Fault, SpoilsFramesInItsTimeAndNoOthers)
{
  for (const FaultKind kind : {FaultKind::black, FaultKind::freeze, FaultKind::noise}) {
    FaultOptions options;
    options.kind = kind;
    options.start_s = 1;
    options.duration_s = 2;
    FaultInjector injector(options);
    for (int k = -5; k < 50; ++k) {
      Frame frame;
      frame.image.resize(8, 8, static_cast<unsigned char>(100 + k));
      const vpImage<unsigned char> before = frame.image;
      const bool is_in_time = k >= 10 && k < 30;
      EXPECT_EQ(injector.apply(frame, 0.1 * k), is_in_time) << toString(kind) << k;
      EXPECT_EQ(frame.image == before, !is_in_time);
      if (kind == FaultKind::freeze && is_in_time) {
        EXPECT_EQ(frame.image[0][0], 109); // the last good one
      }
      EXPECT_EQ(frame.status, FrameStatus::ok); // nobody is told
    }
  }
}

TEST(Fault, SpoilsASensorInItsTimeAndLeavesTheImage)
{
  for (const char *word : {"odometry-freeze", "odometry-jump", "odometry-gone", "gyro-gone", "gyro-bias"}) {
    FaultOptions options{valueNamed<FaultKind>("fault", word), 1};
    FaultInjector injector(options);
    for (int k = 0; k < 20; ++k) {
      Frame frame;
      frame.image.resize(4, 4, 50);
      frame.wMb_odometry = Pose(Eigen::Matrix3d::Identity(), {0.1 * k, 0, 1});
      frame.gyro = {{0, {0, 0, 0.01}}};
      Frame before = frame;
      const bool is_spoilt = injector.apply(frame, 0.1 * k);
      EXPECT_EQ(is_spoilt, k >= 10);
      EXPECT_TRUE(frame.image == before.image);
      const bool has_odometry = frame.wMb_odometry && frame.wMb_odometry->t == before.wMb_odometry->t;
      const bool has_gyro = !frame.gyro.empty() && frame.gyro[0].rate == before.gyro[0].rate;
      EXPECT_EQ(has_odometry && has_gyro, k < 10) << word << k;
    }
  }
  EXPECT_REFUSED("fault = blue, must be none, black, noise, smear, freeze, wrong size, odometry-freeze, odometry-jump, "
                 "odometry-gone, gyro-gone or gyro-bias",
                 valueNamed<FaultKind>("fault", "blue"));
}

/// Sidesteps to map what is there, then flies straight ahead, whatever stands there.
class Headlong : public ServoTask
{
protected:
  bool sees(const FrameReport &) const override { return true; }
  TaskCommand act(const FrameReport &report) override
  {
    const double time_s = 1e-9 * static_cast<double>(report.stamp_ns);
    const Eigen::Vector4d aside = m_sidestep.velocity(report.wMb, time_s);
    if (m_sidestep.elapsed(time_s) < 6)
      return {false, aside, "looks"};
    enter(TaskPhase::servoing);
    return {false, {1, 0, 0, 0}, "headlong"};
  }

private:
  Sidestep m_sidestep{0.6, 6};
};

TEST(ClosedLoop, ADroneThatFliesHeadlongTouchesNothingThatItBelievesWhateverSensorFails)
{
  ForestOptions wood;
  wood.density = 0.02;
  SimulatedTrunk ahead;
  ahead.foot = {5, 0, 0};
  ahead.radius = 0.2;
  const Forest forest = Forest::plant(wood, {{0, -1, 1}, {0, 1, 1}, {4, 0, 1}}, {ahead});
  for (const char *word : {"none", "odometry-freeze", "odometry-jump", "odometry-gone", "gyro-gone", "gyro-bias"}) {
    vpSimulatorArDrone::Options settings = ServoTrialOptions::defaultRobot();
    settings.renderer.samples_per_pixel = 1;
    vpSimulatorArDrone robot(forest, settings);
    const auto perception = realPerception(robot.camera(), robot.bMc(), ServoTrialOptions::defaultPipeline());
    Headlong task;
    LoopOptions options;
    options.duration_s = 7;
    options.fault = {valueNamed<FaultKind>("fault", word), 1, 10};
    const LoopRecord record = runClosedLoop(robot, perception, task, options);
    const LoopSample &last = record.samples.back();
    const bool is_believed = std::any_of(last.map.begin(), last.map.end(), [&](const KnownTrunk &trunk) {
      const Eigen::Vector3d there = last.truth * (last.estimate.inverse() * trunk.trunk.axisAt(last.estimate.t.z()));
      return trunk.status == TrunkStatus::confirmed && (there - ahead.foot).head<2>().norm() < 0.4;
    });
    EXPECT_FALSE(record.is_contact && is_believed) << word;
    if (record.is_contact) { // nothing told it that a trunk stands there: by sight alone
      EXPECT_LT(last.speed, SafetyOptions().unseen_speed + 0.15) << word;
    }
    EXPECT_GT(record.samples.back().truth.t.x(), 0.5) << word << ": it did fly";
  }
}

TEST(ClosedLoop, ASlalomTouchesNothingThoughTheMapLacksThreeTrunksInTenAndNoBarkHasPoints)
{
  int arrived = 0;
  for (const std::uint64_t seed : {400, 402, 406, 409}) {
    ServoTrialOptions options;
    options.scenario.kind = ServoKind::slalom;
    options.scenario.seed = seed;
    options.perception = PerceptionKind::truth;
    options.missing = 0.3;
    options.robot.has_images = false;
    options.loop.duration_s = 90;
    const ServoTrialResult result = runServoTrial(options);
    EXPECT_FALSE(result.record.is_contact) << seed;
    arrived += result.is_success;
  }
  EXPECT_GE(arrived, 3);
}

TEST(ServoTrial, TheSpeedOfASlalomIsFlownBetweenLeavingAndArriving)
{
  ServoTrialOptions options;
  options.scenario.kind = ServoKind::slalom;
  options.scenario.length = 10;
  options.scenario.density = 1e-3;
  options.perception = PerceptionKind::truth;
  options.robot.has_images = false;
  double fastest = 0;
  const ServoTrialResult result = runServoTrial(options, [&](const Frame &, const FrameReport &, const LoopSample &s) {
    fastest = std::max(fastest, s.speed);
    return true;
  });
  ASSERT_TRUE(result.is_success) << result.outcome;
  EXPECT_LT(result.mean_speed, fastest);
  EXPECT_GT(result.mean_speed, result.speed_along);                                              // it swings
  EXPECT_GT(result.speed_along, result.progress / (result.duration_s - result.servoing_from_s)); // then it rests
}

TEST(Scenario, TheGapHasTheWidthItSaysAndIsFree)
{
  ScenarioOptions options;
  options.kind = ServoKind::gap;
  Eigen::Vector3d last(0, 0, 0);
  for (options.seed = 1; options.seed < 20; ++options.seed) {
    const Scenario scenario = makeScenario(options);
    const SimulatedTrunk &left = scenario.forest.trunks[0], &right = scenario.forest.trunks[1];
    const auto at = [](const SimulatedTrunk &trunk) { return Eigen::Vector2d(trunk.axisAt(1.2).head<2>()); };
    const double free = (at(left) - at(right)).norm() - left.radiusAt(1.2) - right.radiusAt(1.2);
    EXPECT_NEAR(free, scenario.gap_width, 1e-9);
    EXPECT_GE(free, 1.3);
    EXPECT_EQ(left.foot, makeScenario(options).forest.trunks[0].foot) << "the same seed";
    EXPECT_NE(left.foot, last) << "another seed";
    last = left.foot;
    const Eigen::Vector2d middle = 0.5 * (at(left) + at(right));
    EXPECT_GT(scenario.forest.distanceToBark({middle.x(), middle.y(), 1.2}), 0.5);
  }
}

TEST(Scenario, NothingStandsBetweenTheCircleAndItsTrunk)
{
  ScenarioOptions options;
  options.kind = ServoKind::circle;
  for (options.seed = 1; options.seed < 20; ++options.seed) {
    const Scenario scenario = makeScenario(options);
    const SimulatedTrunk &target = scenario.forest.trunks[static_cast<std::size_t>(scenario.target)];
    const double circle = target.radius / options.ratio;
    for (const SimulatedTrunk &other : scenario.forest.trunks) {
      const double apart = (other.axisAt(1.2) - target.axisAt(1.2)).head<2>().norm();
      EXPECT_TRUE(other.id == target.id || apart > circle + 0.5) << options.seed << ": " << apart;
    }
  }
}

TEST(Scenario, TrunksStandOnTheSlalomsLineToo)
{
  ScenarioOptions options;
  options.kind = ServoKind::slalom;
  int on_the_line = 0;
  for (options.seed = 1; options.seed < 6; ++options.seed) {
    const Scenario scenario = makeScenario(options);
    for (const SimulatedTrunk &trunk : scenario.forest.trunks)
      on_the_line += std::abs(trunk.foot.y()) < 0.4 && trunk.foot.x() > 2 && trunk.foot.x() < 40;
    EXPECT_GT(scenario.forest.distanceToBark({0, 0, 1.2}), 0.6);
  }
  EXPECT_GT(on_the_line, 3); // 0.05 a m^2 on 5 x 30 m^2: eight are expected
}

/// Flies slowly to the left from the first frame on.
class Leftward : public ServoTask
{
protected:
  bool sees(const FrameReport &) const override { return true; }
  TaskCommand act(const FrameReport &) override
  {
    enter(TaskPhase::servoing);
    return {false, {0, 0.4, 0, 0}, "left"};
  }
};

TEST(ClosedLoop, HoversInTheFrameOfEachFaultAndFliesOnAfterIt)
{
  ForestOptions forest;
  forest.density = 0.02;
  const Forest clearing = Forest::plant(forest, {{0, 0, 1}, {0, 5, 1}}, {});
  for (const FaultKind fault : {FaultKind::black, FaultKind::freeze, FaultKind::noise}) {
    vpSimulatorArDrone::Options settings = ServoTrialOptions::defaultRobot();
    settings.renderer.samples_per_pixel = 1;
    vpSimulatorArDrone robot(clearing, settings);
    const auto perception = realPerception(robot.camera(), robot.bMc(), {});
    Leftward task;
    LoopOptions options;
    options.duration_s = 4;
    options.fault.kind = fault;
    options.fault.start_s = 1;
    options.fault.duration_s = 1.5;
    const LoopRecord record = runClosedLoop(robot, perception, task, options);
    int spoilt = 0, after = 0;
    double speed_at_end_of_fault = 1;
    for (const LoopSample &sample : record.samples) {
      spoilt += sample.is_spoilt;
      EXPECT_TRUE(!sample.is_spoilt || (sample.is_hovering && sample.frame_status != FrameStatus::ok))
          << toString(fault);
      if (sample.is_spoilt)
        speed_at_end_of_fault = sample.speed;
      after += spoilt == 15 && !sample.is_spoilt && !sample.is_hovering;
    }
    EXPECT_EQ(spoilt, 15);
    EXPECT_LT(speed_at_end_of_fault, 0.15); // 0.35 m/s before
    EXPECT_GE(after, 10);
    EXPECT_FALSE(record.is_contact);
  }
}

TEST(ServoTrial, ARecordBecomesAFigureAndATable)
{
  LoopRecord record;
  for (int k = 0; k < 20; ++k) {
    LoopSample sample;
    sample.time_s = 0.1 * k;
    sample.phase = k < 5 ? TaskPhase::searching : TaskPhase::servoing;
    if (k >= 5)
      sample.believed = sample.real = {{"bearing [deg]", 10 * std::exp(-0.2 * k)}};
    record.samples.push_back(sample);
  }
  const std::string csv = samplesCsv(record);
  EXPECT_NE(csv.find("bearing [deg]"), std::string::npos);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 21);
}
} // namespace
