// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "tasks/servo_task.h"
#include <bole/open_source.h>

using namespace bole;

namespace
{
/// Flies ahead while it sees what it is told that it sees.
class Ahead : public ServoTask
{
public:
  using ServoTask::ServoTask;
  bool is_in_view = true;

  int given_up = 0;

protected:
  void giveUpTarget() override { ++given_up; }
  bool sees(const FrameReport &) const override { return is_in_view; }
  TaskCommand act(const FrameReport &) override { return {false, {1, 0, 0, 0}, "ahead"}; }
};

const PinholeCamera kCamera{200, 200, 160, 120, 320, 240};

class Safety : public testing::Test
{
protected:
  bool hovers(Ahead &task, FrameStatus status = FrameStatus::ok)
  {
    FrameReport report;
    report.frame_status = status;
    return task.step(report).is_hovering;
  }
};

TEST_F(Safety, HoversAtOnceWhereAFrameIsNotOk)
{
  for (const FrameStatus status :
       {FrameStatus::stale, FrameStatus::corrupt, FrameStatus::missing, FrameStatus::resized, FrameStatus::doubtful}) {
    Ahead task;
    for (int k = 0; k < 5; ++k)
      ASSERT_FALSE(hovers(task));
    EXPECT_TRUE(hovers(task, status)) << toString(status);
    EXPECT_TRUE(task.isLost());
  }
}

/// What is done in frames that are good (o), not ok (x) or without the target (-): flies (f) or hovers (h).
TEST_F(Safety, HoversWhereATargetWasNotSeenForLongAndUntilFramesAreSureInARow)
{
  SafetyOptions options;
  options.lost_frames = 4;
  options.sure_frames = 3;
  for (const auto &[seen, done] : {std::pair<std::string, std::string>{"o----", "ffffh"}, {"xooxooo", "hhhhhhf"}}) {
    Ahead task(options);
    std::string does;
    for (const char frame : seen) {
      task.is_in_view = frame != '-';
      does += hovers(task, frame == 'x' ? FrameStatus::corrupt : FrameStatus::ok) ? 'h' : 'f';
    }
    EXPECT_EQ(does, done) << seen;
  }
}

TEST_F(Safety, GivesATargetUpAfterGoodFramesWithoutItAndNotForBadOnes)
{
  SafetyOptions options;
  options.patience_frames = 10;
  Ahead task(options);
  ASSERT_FALSE(hovers(task));
  task.is_in_view = false;
  for (int k = 0; k < 30; ++k)
    hovers(task, FrameStatus::corrupt);
  EXPECT_EQ(task.given_up, 0);
  task.is_in_view = true;
  hovers(task);
  task.is_in_view = false;
  for (int k = 0; k < 10; ++k)
    hovers(task);
  EXPECT_EQ(task.given_up, 0);
  EXPECT_TRUE(hovers(task)) << "hovers until it has found another";
  EXPECT_EQ(task.given_up, 1);
}

TEST_F(Safety, AnOdometryThatIsContradictedEndsTheTaskAndAGyroDoesNot)
{
  Ahead task;
  FrameReport report;
  report.verdicts = {{"gyro", "bias", 1, "gyro: biased since 1.0 s"}};
  EXPECT_FALSE(task.step(report).is_hovering);
  report.verdicts.push_back({"odometry", "stuck", 2, "odometry: frozen since 2.0 s"});
  EXPECT_EQ(task.step(report).reason, "odometry: frozen since 2.0 s: hovers");
  EXPECT_EQ(task.phase(), TaskPhase::failed);
  EXPECT_EQ(task.step({}).reason, "odometry: frozen since 2.0 s: hovers");
}

TEST_F(Safety, NoTaskFliesIntoWhatIsBelieved)
{
  for (const bool is_confirmed : {true, false}) {
    Ahead task; // at 1 m/s
    FrameReport report;
    KnownTrunk trunk;
    trunk.status = is_confirmed ? TrunkStatus::confirmed : TrunkStatus::candidate;
    trunk.trunk.xy = {3, 0};
    trunk.log_odds = 3;
    trunk.observations = 20;
    report.map = {trunk};
    for (int k = 0; k < 200; ++k) {
      report.stamp_ns = k * 100000000LL;
      report.wMb.t.x() += 0.1 * task.step(report).velocity.x();
    }
    const SafetyOptions options;
    const double bark = 3 - trunk.trunk.radius() - options.hull;
    EXPECT_EQ(report.wMb.t.x() < bark, is_confirmed) << report.wMb.t.x(); // a candidate is for the planner to avoid
  }
}

TEST(Sidestep, GoesToAndFroByItsAmplitudeAndKeepsItsHeading)
{
  Sidestep sidestep(0.5, 8);
  Pose wMb(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {2, -1, 1.2});
  const Eigen::Vector2d left(-std::sin(0.7), std::cos(0.7)), start = wMb.t.head<2>();
  double most = 0, least = 0;
  for (double t = 0; t < 8; t += 0.02) {
    const Eigen::Vector4d v = sidestep.velocity(wMb, t);
    EXPECT_NEAR(v(3), 0, 1e-9);
    wMb.t += wMb.R * Eigen::Vector3d(0.02 * v(0), 0.02 * v(1), 0);
    const double across = left.dot(wMb.t.head<2>() - start);
    most = std::max(most, across);
    least = std::min(least, across);
    EXPECT_LT((wMb.t.head<2>() - start - across * left).norm(), 1e-9);
  }
  EXPECT_NEAR(most, 0.5, 0.02);
  EXPECT_NEAR(least, -0.5, 0.02);
}

TEST(Towards, TurnsTheShortWayAndSpeaksInTheBody)
{
  const Pose wMb(Eigen::AngleAxisd(3, Eigen::Vector3d::UnitZ()).toRotationMatrix(), Eigen::Vector3d::Zero());
  const Eigen::Vector4d v = towards(wMb, {std::cos(3.0), std::sin(3.0)}, -3);
  EXPECT_NEAR(v(0), 1, 1e-9);
  EXPECT_NEAR(v(1), 0, 1e-9);
  EXPECT_GT(v(3), 0.2); // over pi, not back through zero
}
} // namespace
