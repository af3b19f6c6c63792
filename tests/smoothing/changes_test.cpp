// SPDX-License-Identifier: GPL-2.0-or-later
// Removing, merging, outliers and what leaves the window.
#include "support/dense_reference.h"
#include "support/flight.h"
#include "support/test.h"

#include <malloc.h>

using namespace bole;

namespace
{
using namespace test;

const FlightOptions kShort{60};

/// Round after round past the same trunks.
FlightOptions rounds(int count, int lap = 120)
{
  FlightOptions o;
  o.lap = lap;
  o.poses = count * lap;
  return o;
}

/// A flight in which each trunk that was seen before frame \p from counts as new from then on.
struct Halves
{
  Replay replay;
  std::vector<int> first; ///< ids of before

  Halves(const Flight &flight, const SmootherOptions &options, int from) : replay(flight, options)
  {
    while (replay.next < from)
      replay.step();
    first = replay.trunk_id;
    replay.trunk_id.assign(flight.trunks.size(), -1);
    replay.run();
  }
  void merge()
  {
    for (std::size_t j = 0; j < first.size(); ++j)
      if (first[j] >= 0 && replay.trunk_id[j] >= 0)
        replay.smoother.mergeTrunks(first[j], replay.trunk_id[j]);
    replay.smoother.update();
  }
};

TEST(Changes, RemovingATrunkLeavesTheOptimumOfTheRest)
{
  const Flight flight = simulateFlight(kShort);
  Replay replay(flight, smootherFor(kShort));
  replay.run();
  const std::size_t trunks = replay.smoother.graph().trunks.size();

  replay.smoother.removeTrunk(1);
  replay.smoother.update();
  replay.smoother.optimize();

  DenseReference dense(replay.smoother.graph());
  EXPECT_EQ(dense.graph().trunks.size(), trunks - 1);
  EXPECT_NEAR(replay.smoother.cost(), dense.solve(), 1e-6 * dense.solve());
  EXPECT_THROW(replay.smoother.trunk(1), vpException);
}

TEST(Changes, MergingTwoHalvesOfATrunkGivesTheGraphOfTheWhole)
{
  const Flight flight = simulateFlight(kShort);
  Replay whole(flight, smootherFor(kShort));
  Halves halves(flight, smootherFor(kShort), 20);
  whole.run();

  halves.merge();
  halves.replay.smoother.optimize();
  whole.smoother.optimize();

  EXPECT_EQ(halves.replay.smoother.observationCount(), whole.smoother.observationCount());
  for (std::size_t j = 0; j < halves.first.size(); ++j)
    if (const int id = halves.first[j]; id >= 0) {
      EXPECT_LT(halves.replay.smoother.trunk(id).minus(whole.smoother.trunk(whole.trunk_id[j])).norm(), 2e-3);
    }
}

TEST(Changes, WronglyAssociatedViewsDoNotBendTheMap)
{
  FlightOptions dirty = kShort;
  dirty.outliers = 0.03;
  const Flight flight = simulateFlight(dirty);
  Replay robust(flight, smootherFor(kShort));
  SmootherOptions quadratic = smootherFor(kShort);
  quadratic.summary_loss.kind = LossKind::quadratic;
  Replay plain(flight, quadratic);
  robust.run();
  plain.run();

  const auto error = [&](Replay &replay) {
    replay.smoother.optimize();
    double sum = 0;
    for (int i = 0; i < 60; ++i)
      sum += replay.smoother.pose(i).minus(flight.truth[i]).head<3>().squaredNorm();
    return std::sqrt(sum / 60);
  };
  EXPECT_LT(error(robust), 0.5 * error(plain));
}

SmootherOptions forgetting(const FlightOptions &o, int window)
{
  SmootherOptions options = smootherFor(o);
  options.window = window;
  options.forgets = true;
  return options;
}

TEST(Changes, AWindowThatForgetsStaysNearTheWhole)
{
  FlightOptions o{200};
  const Flight flight = simulateFlight(o);
  Replay full(flight, smootherFor(o)), window(flight, forgetting(o, 40));
  full.run();
  full.smoother.optimize();
  window.run();

  EXPECT_EQ(window.smoother.graph().poses.size(), 40u);
  const Vector6d apart = window.smoother.pose(199).minus(full.smoother.pose(199));
  const Matrix6d C = full.smoother.currentPoseCovariance();
  for (int i = 0; i < 6; ++i)
    EXPECT_LT(std::abs(apart(i)), std::sqrt(C(i, i))) << i;
  const Eigen::ArrayXd sigma = window.smoother.currentPoseCovariance().diagonal().array().sqrt();
  EXPECT_LT((sigma / C.diagonal().array().sqrt() - 1).abs().maxCoeff(), 0.1);
}

/// What a pull at the last pose costs in the end is what the graph resists, with all poses at hand and with those
/// that were forgotten as a quadratic.
TEST(Changes, WhatLeftTheWindowResistsAsItDidBefore)
{
  constexpr double kPull = 0.05, kSure = 0.02; // [m]
  FlightOptions o{90};
  const Flight flight = simulateFlight(o);
  std::vector<double> cost, moved;
  for (const bool forgets : {false, true}) {
    SmootherOptions options = forgetting(o, 40);
    options.forgets = forgets;
    Replay replay(flight, options);
    replay.run();
    replay.smoother.optimize(1e-12);
    const double before = replay.smoother.cost();
    const Pose at = replay.smoother.pose(89);
    PosePrior pull;
    pull.mean = at.plus((Vector6d() << 0, kPull, 0, 0, 0, 0).finished());
    pull.covariance = kSure * kSure * Matrix6d::Identity();
    replay.smoother.addPosePrior(89, pull);
    const UpdateResult pulled = replay.smoother.optimize(1e-12);
    EXPECT_EQ(pulled.status, UpdateStatus::ok) << forgets;
    EXPECT_NEAR(pulled.cost, replay.smoother.cost(), 1e-6 * std::abs(pulled.cost)) << forgets;
    cost.push_back(replay.smoother.cost() - before);
    moved.push_back(replay.smoother.pose(89).minus(at)(1));
  }
  EXPECT_GT(cost[0], 0.1);
  EXPECT_NEAR(cost[1], cost[0], 0.15 * cost[0]); // radii were less known where they were linearised
  EXPECT_NEAR(moved[1], moved[0], 0.1 * moved[0]);
}

TEST(Changes, AFactorWithAForgottenEndIsNotAdded)
{
  FlightOptions o{100};
  const Flight flight = simulateFlight(o);
  Replay window(flight, forgetting(o, 20));
  window.run();
  const Graph before = window.smoother.graph();

  window.smoother.addRelativePose(50, 99, RelativePoseMeasurement());
  window.smoother.addOdometry(99, 50, Odometry());

  EXPECT_EQ(window.smoother.graph().relative_poses.size(), before.relative_poses.size());
  EXPECT_EQ(window.smoother.graph().odometry.size(), before.odometry.size());
}

TEST(Changes, ATrunkThatWasForgottenStandsWhereItWasWhenItIsSeenAgain)
{
  FlightOptions o{260};
  const Flight flight = simulateFlight(o);
  SmootherOptions options = forgetting(o, 20);
  options.remembered = 0;
  Replay window(flight, options);
  window.run();
  const Trunk before = window.smoother.trunk(0);
  SummaryFactor view;
  view.optimum = window.smoother.predictedRelative(0);
  view.F *= 1e4;

  EXPECT_EQ(window.smoother.addObservation(259, 0, view), SummaryStatus::ok);
  window.smoother.update();

  EXPECT_LT(window.smoother.trunk(0).minus(before).norm(), 0.05);
  EXPECT_GT(std::sqrt(window.smoother.trunkCovariance(0).topLeftCorner<2, 2>().trace()), 0.3)
      << "one view tells no range";
}

/// Two halves of a trunk that both left a window that forgets: each says of the one trunk what it said before.
TEST(Changes, TrunksThatLeftTheWindowAreMergedInItsPrior)
{
  const FlightOptions o = rounds(2);
  const Flight flight = simulateFlight(o);
  Replay whole(flight, forgetting(o, 30));
  Halves halves(flight, forgetting(o, 30), o.lap);
  const Smoother &merged_one = halves.replay.smoother;
  whole.run();
  const auto apart = [&] {
    return merged_one.pose(o.poses - 1).minus(whole.smoother.pose(o.poses - 1)).head<2>().norm();
  };
  const double before = apart();

  halves.merge();

  const double sigma = std::sqrt(whole.smoother.currentPoseCovariance().topLeftCorner<2, 2>().trace());
  EXPECT_LT(apart(), 0.5 * sigma);
  EXPECT_LT(apart(), before);
  const double merged = std::sqrt(merged_one.currentPoseCovariance().topLeftCorner<2, 2>().trace());
  EXPECT_NEAR(merged / sigma, 1, 0.15);
}

TEST(Changes, AHypothesisThatIsGivenUpAfterItsViewsLeftTheWindowIsAsIfItHadNeverBeen)
{
  FlightOptions o{120};
  const Flight flight = simulateFlight(o);
  Replay with(flight, forgetting(o, 30)), without(flight, forgetting(o, 30));
  std::size_t wrong = 0;
  for (int i = 0; i < o.poses; ++i) {
    without.step();
    with.add();
    SummaryFactor view = flight.views[static_cast<std::size_t>(i)].front().second;
    view.optimum = view.optimum.plus(Vector4d(0, 0, 0.1, 0.3));
    if (i == 20) {
      wrong = with.smoother.addTrunk(
          trunkFromRelative(with.smoother.pose(20) * with.smoother.options().bMc, view.optimum, 0.15));
      with.smoother.keepTrunk(wrong, false);
    }
    if (i >= 20 && i < 60)
      with.smoother.addObservation(static_cast<std::size_t>(i), wrong, view);
    if (i == 80)
      with.smoother.removeTrunk(wrong);
    with.smoother.update();
  }
  const Vector6d apart = with.smoother.pose(119).minus(without.smoother.pose(119));
  EXPECT_LT((apart.array() / without.smoother.currentPoseCovariance().diagonal().array().sqrt()).abs().maxCoeff(), 0.5);
  EXPECT_TRUE(with.smoother.currentPoseCovariance().isApprox(without.smoother.currentPoseCovariance(), 0.05));
}

TEST(Changes, NewTrunksStandWhereTheyAreAlsoWhenAllOfTheFlightWasShifted)
{
  FlightOptions o{140};
  Flight flight = simulateFlight(o);
  flight.first_covariance.diagonal().head<2>().setConstant(1e2);
  Replay replay(flight, smootherFor(o));
  while (replay.next < 60)
    replay.step();
  PosePrior elsewhere;
  elsewhere.mean = replay.smoother.pose(59);
  elsewhere.mean.t += Eigen::Vector3d(3, 0, 0); // farther than half the distance of any trunk
  elsewhere.covariance = Matrix6d::Identity();
  elsewhere.covariance.topLeftCorner<3, 3>() *= 1e-6;
  replay.smoother.addPosePrior(59, elsewhere);

  replay.run();

  std::vector<Trunk> online;
  for (const auto &[j, summary] : flight.views.back())
    online.push_back(replay.smoother.trunk(replay.trunk_id[j]));
  ASSERT_GE(online.size(), 3u);
  replay.smoother.optimize();
  for (std::size_t k = 0; k < online.size(); ++k) {
    const Trunk best = replay.smoother.trunk(replay.trunk_id[flight.views.back()[k].first]);
    EXPECT_LT((best.xy - online[k].xy).norm(), 0.05) << k;
  }
}

/// Of the last pose of eight rounds past the same trunks, of which the window spans a quarter of a round.
struct Return
{
  Vector6d apart; ///< from all that is open, in its standard deviations
  Vector6d sigma; ///< over that of all that is open
};

Return afterRounds(int remembered)
{
  const FlightOptions o = rounds(8);
  const Flight flight = simulateFlight(o);
  SmootherOptions options = forgetting(o, o.lap / 4);
  options.remembered = remembered;
  Replay full(flight, smootherFor(o)), window(flight, options);
  full.run();
  full.smoother.optimize();
  window.run();
  const std::size_t last = static_cast<std::size_t>(o.poses) - 1;
  const Eigen::ArrayXd exact = full.smoother.currentPoseCovariance().diagonal().array().sqrt();
  const Eigen::ArrayXd sigma = window.smoother.currentPoseCovariance().diagonal().array().sqrt();
  return {window.smoother.pose(last).minus(full.smoother.pose(last)).array() / exact, sigma / exact};
}

TEST(Changes, RememberedTrunksTieTheRoundsTogetherThatTheWindowHasLeft)
{
  const Return with = afterRounds(24), without = afterRounds(0);
  EXPECT_LT(with.apart.cwiseAbs().maxCoeff(), 1);
  EXPECT_LT((with.sigma - Vector6d::Ones()).cwiseAbs().maxCoeff(), 0.1);
  EXPECT_GT((without.sigma - Vector6d::Ones()).maxCoeff(), 0.2); // what is not tied drifts, and says so
}

TEST(Changes, ThirtyRoundsStayAsNearToTheTruthAsTheySay)
{
  FlightOptions o = rounds(30);
  o.sigma_position = 0.04;
  o.sigma_ratio = 0.2;
  o.seed = 2;
  const Flight flight = simulateFlight(o);
  Replay window(flight, forgetting(o, o.lap / 10));
  double worst = 0;
  for (int i = 0; i < o.poses; ++i) {
    window.step();
    const Vector6d error = window.smoother.pose(static_cast<std::size_t>(i)).minus(flight.truth[std::size_t(i)]);
    const Eigen::ArrayXd sigma = window.smoother.currentPoseCovariance().diagonal().array().sqrt();
    worst = std::max(worst, (error.array() / sigma).abs().maxCoeff());
  }
  EXPECT_LT(worst, 6); // of 21,600 errors that are correlated
}

/// Bytes of the heap a frame that twelve rounds keep after the fourth, with trunks that are given up a frame later.
double keptAFrame(int remembered)
{
  const FlightOptions o = rounds(12, 100);
  const Flight flight = simulateFlight(o);
  SmootherOptions options = forgetting(o, 40);
  options.remembered = remembered;
  Replay replay(flight, options);
  const auto held = [] {
    const auto heap = mallinfo2();
    return static_cast<double>(heap.uordblks + heap.hblkhd);
  };
  double before = 0;
  std::vector<std::size_t> given_up;
  for (int i = 0; i < o.poses; ++i) {
    if (i == 4 * o.lap)
      before = held();
    replay.add();
    for (const std::size_t trunk : given_up)
      replay.smoother.removeTrunk(trunk);
    given_up.clear();
    const auto &views = flight.views[static_cast<std::size_t>(i)];
    for (int k = 0; k < 2 && i > 0 && !views.empty(); ++k) {
      const SummaryFactor &summary = views.front().second;
      const Pose wMc = replay.smoother.pose(static_cast<std::size_t>(i)) * options.bMc;
      given_up.push_back(replay.smoother.addTrunk(trunkFromRelative(wMc, summary.optimum, 0.15)));
      replay.smoother.addObservation(static_cast<std::size_t>(i), given_up.back(), summary);
    }
    replay.smoother.update();
  }
  return (held() - before) / (8 * o.lap);
}

TEST(Changes, AWindowThatForgetsKeepsAPoseAFrameAndNothingElse)
{
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer's heap is not the one that mallinfo2() tells of";
#endif
  constexpr double kMost = 300; // bytes: a pose, in a list that grows by doubling
  EXPECT_LT(keptAFrame(24), kMost);
  EXPECT_LT(keptAFrame(0), kMost);
}
} // namespace
