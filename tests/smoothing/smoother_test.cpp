// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/dense_reference.h"
#include "support/flight.h"

#include <gmock/gmock.h>

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

double relativeExcess(double value, double reference) { return (value - reference) / reference; }

TEST(Smoother, OptimizeReachesTheCostOfADenseBatchSolve)
{
  for (const int poses : {20, 60}) {
    FlightOptions o;
    o.poses = poses;
    const Flight flight = simulateFlight(o);
    Replay replay(flight, smootherFor(o));
    replay.run();

    replay.smoother.optimize();

    DenseReference dense(replay.smoother.graph());
    const double reference = dense.solve();
    EXPECT_LT(std::abs(relativeExcess(replay.smoother.cost(), reference)), 1e-6) << poses;
  }
}

TEST(Smoother, AStepBeyondItsLinearisationIsTakenInPart)
{
  constexpr double kThicker = 2, kMost = 0.7; // of log r: what the view asks for, what one step may change
  SmootherOptions options;
  options.max_iterations = 1;
  Smoother smoother(options);
  smoother.addFirstPose(Pose(), 1e-6 * Matrix6d::Identity());
  TrunkPrior prior;
  prior.mean.xy = {4, 0.3};
  prior.mean.log_radius = std::log(0.05);
  prior.sigma << 0.01, 0.01, 10, 0.01, 0.01;
  const std::size_t trunk = smoother.addTrunk(prior.mean, prior);
  SummaryFactor view;
  view.optimum = smoother.predictedRelative(trunk).plus({0, 0, 0, kThicker});
  view.F = 1e4 * Matrix4d::Identity();
  smoother.addObservation(0, trunk, view);

  smoother.update();

  EXPECT_NEAR(smoother.trunk(trunk).log_radius - prior.mean.log_radius, kMost, 1e-6);
  smoother.optimize();
  EXPECT_NEAR(smoother.trunk(trunk).log_radius - prior.mean.log_radius, kThicker, 0.01);
}

TEST(Smoother, UpdatesAloneStayNearTheBatchSolve)
{
  FlightOptions o;
  o.poses = 80;
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o));

  replay.run();

  DenseReference dense(replay.smoother.graph());
  EXPECT_LT(relativeExcess(replay.smoother.cost(), dense.solve()), 5e-3);
}

TEST(Smoother, UpdatesWithTightThresholdsReachTheBatchSolve)
{
  FlightOptions o;
  o.poses = 80;
  const Flight flight = simulateFlight(o);
  SmootherOptions options = smootherFor(o);
  options.relinearise_position = options.relinearise_rotation = 1e-5;
  options.relinearise_log_radius = options.relinearise_lean = 1e-5;
  options.linearisation_tolerance = 1e-5;
  options.propagation_threshold = 0;
  options.max_iterations = 20;
  Replay replay(flight, options);

  replay.run();

  DenseReference dense(replay.smoother.graph());
  EXPECT_LT(std::abs(relativeExcess(replay.smoother.cost(), dense.solve())), 1e-6);
}

TEST(Smoother, CostOfUpdateIsThatOfTheGraphOnceSettled)
{
  FlightOptions o;
  o.poses = 40;
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o));
  replay.run();
  replay.smoother.optimize();

  EXPECT_NEAR(replay.smoother.cost(), cost(replay.smoother.graph()), 1e-9);
}

/// Poses are linearised anew on the way, and under the lag the closed ones are a factor on the open ones.
TEST(Smoother, CostOfAnUpdateIsThatOfAllFactorsAlsoUnderALag)
{
  FlightOptions o;
  o.poses = 90;
  const Flight flight = simulateFlight(o);
  for (const int lag : {0, 30}) {
    SmootherOptions options = smootherFor(o);
    options.fixed_lag = lag;
    Replay replay(flight, options);
    replay.run();
    const UpdateResult settled = replay.smoother.optimize(1e-10);
    EXPECT_GT(settled.cost, 1) << lag;
    EXPECT_NEAR(settled.cost, replay.smoother.cost(), 1e-3 * std::abs(settled.cost)) << lag;
    if (lag == 0) { // else what is closed counts in one of them
      EXPECT_NEAR(replay.smoother.update().cost, settled.cost, 1e-3 * std::abs(settled.cost));
    }
  }
}

TEST(Smoother, ReachesTheBatchOptimumAfterALoopThatReturnsToOldTrunks)
{
  FlightOptions o;
  o.poses = 130;
  o.lap = 80;
  o.spacing = 0.8;
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o));
  replay.run();
  DenseReference before(replay.smoother.graph());

  replay.smoother.optimize();

  EXPECT_LT(std::abs(relativeExcess(replay.smoother.cost(), before.solve())), 1e-6);
}
} // namespace
} // namespace bole
