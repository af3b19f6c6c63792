// SPDX-License-Identifier: GPL-2.0-or-later
// Removing, merging, outliers and the lag.
#include "support/dense_reference.h"
#include "support/flight.h"

#include <gmock/gmock.h>
#include <malloc.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
using test::DenseReference;
using test::Flight;
using test::FlightOptions;
using test::Replay;
using test::simulateFlight;
using test::smootherFor;

FlightOptions shortFlight()
{
  FlightOptions o;
  o.poses = 60;
  return o;
}

TEST(Changes, RemovingATrunkLeavesTheOptimumOfTheRest)
{
  const Flight flight = simulateFlight(shortFlight());
  Replay replay(flight, smootherFor(shortFlight()));
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

TEST(Changes, AViewThatWasTakenBackIsAsIfItHadNeverBeen)
{
  const Flight flight = simulateFlight(shortFlight());
  Replay with(flight, smootherFor(shortFlight())), without(flight, smootherFor(shortFlight()));
  with.run();
  without.run();
  const auto &[seen, summary] = flight.views.back().front();
  SummaryFactor wrong = summary;
  wrong.optimum = wrong.optimum.plus(Vector4d(0.02, 0, 0.05, 0.2));
  const auto trunk = static_cast<std::size_t>(with.trunk_id[static_cast<std::size_t>(seen)]);
  const std::size_t pose = with.smoother.poseCount() - 1;

  with.smoother.removeObservation(pose, trunk);
  with.smoother.addObservation(pose, trunk, wrong);
  with.smoother.update();
  with.smoother.removeObservation(pose, trunk);
  with.smoother.addObservation(pose, trunk, summary);
  with.smoother.optimize();
  without.smoother.optimize();

  EXPECT_EQ(with.smoother.observationCount(), without.smoother.observationCount());
  EXPECT_NEAR(with.smoother.cost(), without.smoother.cost(), 1e-6 * without.smoother.cost());
  EXPECT_LT(with.smoother.trunk(trunk).minus(without.smoother.trunk(trunk)).norm(), 1e-3);
}

TEST(Changes, MergingTwoHalvesOfATrunkGivesTheGraphOfTheWhole)
{
  const Flight flight = simulateFlight(shortFlight());
  Replay whole(flight, smootherFor(shortFlight())), halves(flight, smootherFor(shortFlight()));
  whole.run();
  std::vector<int> first;
  for (int i = 0; i < 60; ++i) {
    if (i == 20) { // from here on every trunk counts as new
      first = halves.trunk_id;
      halves.trunk_id.assign(flight.trunks.size(), -1);
    }
    halves.step();
  }

  for (std::size_t j = 0; j < first.size(); ++j)
    if (first[j] >= 0 && halves.trunk_id[j] >= 0)
      halves.smoother.mergeTrunks(first[j], halves.trunk_id[j]);
  halves.smoother.update();
  halves.smoother.optimize();
  whole.smoother.optimize();

  EXPECT_EQ(halves.smoother.observationCount(), whole.smoother.observationCount());
  for (std::size_t j = 0; j < first.size(); ++j)
    if (first[j] >= 0) {
      EXPECT_LT(halves.smoother.trunk(first[j]).minus(whole.smoother.trunk(whole.trunk_id[j])).norm(), 2e-3);
    }
}

TEST(Changes, WronglyAssociatedViewsDoNotBendTheMap)
{
  FlightOptions clean = shortFlight(), dirty = shortFlight();
  dirty.outliers = 0.03;
  const Flight flight = simulateFlight(dirty);
  Replay robust(flight, smootherFor(clean));
  SmootherOptions quadratic = smootherFor(clean);
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

TEST(Changes, TheLagClosesOldPosesAndStaysNearTheFullSmoother)
{
  FlightOptions o;
  o.poses = 200;
  const Flight flight = simulateFlight(o);
  SmootherOptions lagged = smootherFor(o);
  lagged.fixed_lag = 60;
  Replay full(flight, smootherFor(o)), window(flight, lagged);
  full.run();
  window.run();

  const Graph open = window.smoother.graph();
  EXPECT_LE(open.poses.size(), 62u);
  const Vector6d apart = window.smoother.pose(199).minus(full.smoother.pose(199));
  const Matrix6d C = full.smoother.currentPoseCovariance();
  for (int i = 0; i < 6; ++i)
    EXPECT_LT(std::abs(apart(i)), std::sqrt(C(i, i))) << i;
  for (const std::size_t pose : {40u, 90u, 130u}) { // closed when 60 frames had come after them
    const double closed = window.smoother.poseCovariance(pose).topLeftCorner<2, 2>().trace(),
                 open_still = full.smoother.poseCovariance(pose).topLeftCorner<2, 2>().trace();
    EXPECT_NEAR(std::sqrt(closed / open_still), 1, 0.35) << pose;
  }
  EXPECT_NEAR(std::sqrt(window.smoother.currentPoseCovariance()(0, 0) / C(0, 0)), 1, 0.1);
}

/// What a pull at the last pose costs in the end is what the graph resists, with all poses open and with the closed
/// ones as a quadratic.
TEST(Changes, WhatTheLagClosedResistsAsItDidBefore)
{
  constexpr double kPull = 0.05, kSure = 0.02; // [m]
  FlightOptions o;
  o.poses = 90;
  const Flight flight = simulateFlight(o);
  std::vector<double> cost, moved;
  for (const int lag : {0, 40}) {
    SmootherOptions options = smootherFor(o);
    options.fixed_lag = lag;
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
    EXPECT_EQ(pulled.status, UpdateStatus::ok) << lag;
    EXPECT_NEAR(pulled.cost, replay.smoother.cost(), 1e-6 * pulled.cost) << lag;
    cost.push_back(replay.smoother.cost() - before);
    moved.push_back(replay.smoother.pose(89).minus(at)(1));
  }
  EXPECT_GT(cost[0], 0.1);
  EXPECT_NEAR(cost[1], cost[0], 0.05 * cost[0]);
  EXPECT_NEAR(moved[1], moved[0], 0.1 * moved[0]);
}

TEST(Changes, ALongLagClosesPosesAlsoWhereOldTrunksReturn)
{
  FlightOptions o;
  o.poses = 600;
  o.lap = 120;
  const Flight flight = simulateFlight(o);
  SmootherOptions lagged = smootherFor(o);
  lagged.fixed_lag = 200;
  Replay window(flight, lagged);
  window.run();
  EXPECT_LE(window.smoother.graph().poses.size(), 202u);
}

TEST(Changes, WorkAFrameDoesNotGrowWithRoundsPastTheSameTrunks)
{
  FlightOptions o;
  o.lap = 120;
  o.poses = 20 * o.lap;
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o));
  std::vector<double> eliminated(20, 0.0); // a round
  for (int i = 0; i < o.poses; ++i)
    eliminated[static_cast<std::size_t>(i / o.lap)] += static_cast<double>(replay.step().eliminated);
  const double early = eliminated[3] + eliminated[4] + eliminated[5];
  const double late = eliminated[17] + eliminated[18] + eliminated[19];
  EXPECT_LT(late, 2 * early);
  Smoother batch(replay.smoother.graph(), replay.smoother.options());
  batch.optimize();
  EXPECT_LT(replay.smoother.cost(), 1.03 * batch.cost());
}

TEST(Changes, AFactorWithAMarginalisedEndIsNotAdded)
{
  FlightOptions o;
  o.poses = 100;
  const Flight flight = simulateFlight(o);
  SmootherOptions lagged = smootherFor(o);
  lagged.fixed_lag = 20;
  Replay window(flight, lagged);
  window.run();
  const Graph before = window.smoother.graph();

  window.smoother.addRelativePose(50, 99, RelativePoseMeasurement());
  window.smoother.addOdometry(99, 50, Odometry());

  EXPECT_EQ(window.smoother.graph().relative_poses.size(), before.relative_poses.size());
  EXPECT_EQ(window.smoother.graph().odometry.size(), before.odometry.size());
}

TEST(Changes, ATrunkClosedByTheLagOpensAgainOnItsLastCovariance)
{
  FlightOptions o;
  o.poses = 260;
  const Flight flight = simulateFlight(o);
  SmootherOptions lagged = smootherFor(o);
  lagged.fixed_lag = 20;
  Replay window(flight, lagged);
  window.run();
  const Trunk before = window.smoother.trunk(0);
  SummaryFactor view;
  view.optimum = window.smoother.predictedRelative(0);
  view.F *= 1e4;

  EXPECT_EQ(window.smoother.addObservation(259, 0, view), SummaryStatus::ok);
  window.smoother.update();

  EXPECT_LT(window.smoother.trunk(0).minus(before).norm(), 0.05);
}
TEST(Changes, NewTrunksStandWhereTheyAreAlsoWhenAllOfTheFlightWasShifted)
{
  FlightOptions o;
  o.poses = 140;
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

/// Bytes by which a smoother grows from the 100th to the 200th frame, with trunks that are given up a frame later.
double growth(int candidates, int fixed_lag)
{
  FlightOptions o;
  o.poses = 200;
  const Flight flight = simulateFlight(o);
  SmootherOptions options = smootherFor(o);
  options.fixed_lag = fixed_lag;
  Replay replay(flight, options);
  std::size_t at_half = 0;
  std::vector<std::size_t> given_up;
  for (int i = 0; i < o.poses; ++i) {
    if (i == 100)
      at_half = replay.smoother.memoryBytes();
    replay.add();
    for (const std::size_t trunk : given_up)
      replay.smoother.removeTrunk(trunk);
    given_up.clear();
    for (int k = 0; k < candidates && i > 20; ++k) {
      const SummaryFactor &summary = flight.views[i].front().second;
      const Pose wMc = replay.smoother.pose(i) * options.bMc;
      given_up.push_back(replay.smoother.addTrunk(trunkFromRelative(wMc, summary.optimum, 0.15)));
      for (int back = 0; back < 10; ++back)
        replay.smoother.addObservation(i - back, given_up.back(), summary);
    }
    replay.smoother.update();
  }
  return static_cast<double>(replay.smoother.memoryBytes()) - static_cast<double>(at_half);
}

TEST(Changes, TrunksThatAreGivenUpGiveTheirMemoryBack) { EXPECT_LT(growth(3, 0), 1.5 * growth(0, 0)); }

TEST(Changes, AnOptimisationKeepsNoMoreThanTheUpdates)
{
  FlightOptions o;
  o.poses = 300;
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o));
  replay.run();
  const std::size_t online = replay.smoother.memoryBytes();
  replay.smoother.optimize();
  EXPECT_LT(replay.smoother.memoryBytes(), 1.1 * online);
}

/// Of the last pose of eight rounds past the same trunks, of which the lag spans half a round.
struct Return
{
  Vector6d apart; ///< from all that is open, in its standard deviations
  Vector6d sigma; ///< over that of all that is open
};

Return afterRounds(bool is_kept)
{
  FlightOptions o;
  o.lap = 120;
  o.poses = 8 * o.lap;
  const Flight flight = simulateFlight(o);
  SmootherOptions lagged = smootherFor(o);
  lagged.fixed_lag = o.lap / 2;
  Replay full(flight, smootherFor(o)), window(flight, lagged);
  full.run();
  for (int i = 0; i < o.poses; ++i) {
    window.step();
    if (is_kept)
      for (const auto &[j, summary] : flight.views[static_cast<std::size_t>(i)])
        window.smoother.keepTrunk(window.trunk_id[j], true);
  }
  const std::size_t last = static_cast<std::size_t>(o.poses) - 1;
  const Eigen::ArrayXd exact = full.smoother.currentPoseCovariance().diagonal().array().sqrt();
  const Eigen::ArrayXd sigma = window.smoother.currentPoseCovariance().diagonal().array().sqrt();
  return {window.smoother.pose(last).minus(full.smoother.pose(last)).array() / exact, sigma / exact};
}

TEST(Changes, KeptTrunksTieTheRoundsTogetherThatTheLagHasClosed)
{
  const Return with = afterRounds(true), without = afterRounds(false);
  EXPECT_LT(with.apart.cwiseAbs().maxCoeff(), 1);
  EXPECT_LT((with.sigma - Vector6d::Ones()).cwiseAbs().maxCoeff(), 0.1);
  EXPECT_GT((without.sigma - Vector6d::Ones()).cwiseAbs().maxCoeff(), 0.2); // a closed trunk counts twice what it knows
}

/// Bytes a frame that twelve rounds under a lag keep after the fourth, with trunks that are given up a frame later.
double keptAFrame(bool is_kept)
{
  FlightOptions o;
  o.lap = 100;
  o.poses = 12 * o.lap;
  const Flight flight = simulateFlight(o);
  SmootherOptions options = smootherFor(o);
  options.fixed_lag = 40;
  Replay replay(flight, options);
  double before = 0;
  std::vector<std::size_t> given_up;
  for (int i = 0; i < o.poses; ++i) {
    if (i == 4 * o.lap)
      before = static_cast<double>(replay.smoother.memoryBytes());
    replay.add();
    for (const std::size_t trunk : given_up)
      replay.smoother.removeTrunk(trunk);
    given_up.clear();
    const auto &views = flight.views[static_cast<std::size_t>(i)];
    for (const auto &[j, summary] : views)
      replay.smoother.keepTrunk(replay.trunk_id[j], is_kept);
    for (int k = 0; k < 2 && i > 0 && !views.empty(); ++k) {
      const SummaryFactor &summary = views.front().second;
      const Pose wMc = replay.smoother.pose(static_cast<std::size_t>(i)) * options.bMc;
      given_up.push_back(replay.smoother.addTrunk(trunkFromRelative(wMc, summary.optimum, 0.15)));
      replay.smoother.addObservation(static_cast<std::size_t>(i), given_up.back(), summary);
    }
    replay.smoother.update();
  }
  return (static_cast<double>(replay.smoother.memoryBytes()) - before) / (8 * o.lap);
}

TEST(Changes, ALongFlightUnderALagKeepsAPoseAFrameAndNothingElse)
{
  constexpr double kPose = 160; // bytes: the pose, and its part of the covariances
  EXPECT_LT(keptAFrame(true), kPose);
  EXPECT_LT(keptAFrame(false), kPose);
}

/// By what the heap grows by while a flight is solved.
TEST(Changes, TheBytesToldAreThoseThatAreHeld)
{
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer's heap is not the one that mallinfo2() tells of";
#endif
  FlightOptions o;
  o.poses = 400;
  const Flight flight = simulateFlight(o);
  const auto held = [] {
    const auto heap = mallinfo2();
    return static_cast<double>(heap.uordblks + heap.hblkhd);
  };
  const double before = held();
  Replay replay(flight, smootherFor(o));
  replay.run();
  const double grown = held() - before;
  EXPECT_NEAR(static_cast<double>(replay.smoother.memoryBytes()) / grown, 1, 0.15);
}

/// Neither the views of a trunk nor the poses that they were taken from are solved again for a view that says nothing
/// new: the change is too small to run down the tree.
TEST(Changes, AViewAsExpectedIsTakenInWithoutSolvingTheFlightAgain)
{
  FlightOptions o;
  o.poses = 100;
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o));
  replay.run();
  Smoother &smoother = replay.smoother;
  smoother.optimize();
  const std::size_t trunk = static_cast<std::size_t>(replay.trunk_id[flight.views.back().front().first]);
  SummaryFactor view = flight.views.back().front().second;
  view.optimum = smoother.predictedRelative(trunk);
  smoother.addObservation(smoother.poseCount() - 1, trunk, view);

  const UpdateResult result = smoother.update();

  EXPECT_EQ(result.status, UpdateStatus::ok);
  EXPECT_EQ(result.relinearised, 0u);
  EXPECT_EQ(result.resolved, result.eliminated);
}

TEST(Changes, TheLagGivesMemoryBack) { EXPECT_LT(growth(0, 40), 0.2 * growth(0, 0)); }
} // namespace
} // namespace bole
