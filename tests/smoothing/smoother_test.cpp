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
