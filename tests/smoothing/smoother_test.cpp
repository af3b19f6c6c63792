// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/dense_reference.h"
#include "support/flight.h"
#include "support/test.h"

using namespace bole;

namespace
{
using namespace test;

double relativeExcess(double value, double reference) { return (value - reference) / reference; }

TEST(Smoother, OptimizeReachesTheCostOfADenseBatchSolveAlsoAfterALoopThatReturnsToOldTrunks)
{
  FlightOptions loop{130};
  loop.lap = 80;
  loop.spacing = 0.8;
  FlightOptions ahead{60};
  for (const FlightOptions &o : {ahead, loop}) {
    const Flight flight = simulateFlight(o);
    Replay replay(flight, smootherFor(o));
    replay.run();
    DenseReference dense(replay.smoother.graph());

    replay.smoother.optimize();

    EXPECT_LT(std::abs(relativeExcess(replay.smoother.cost(), dense.solve())), 1e-6) << o.poses;
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

/// The window is half of the flight: what it says of now is what all of the flight says.
TEST(Smoother, UpdatesAloneStayNearTheBatchSolve)
{
  FlightOptions o{80};
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o)), batch(flight, smootherFor(o));

  replay.run();
  batch.run();
  batch.smoother.optimize(1e-12);

  const auto inSigmas = [](const auto &apart, const auto &covariance) {
    return std::sqrt(apart.dot(covariance.llt().solve(apart)) / static_cast<double>(apart.size()));
  };
  const Vector6d apart = replay.smoother.pose(79).minus(batch.smoother.pose(79));
  EXPECT_LT(inSigmas(apart, batch.smoother.currentPoseCovariance()), 0.3);
  for (const auto &[j, summary] : flight.views.back()) {
    const auto id = static_cast<std::size_t>(replay.trunk_id[j]);
    const Vector5d off = replay.smoother.trunk(id).minus(batch.smoother.trunk(id));
    EXPECT_LT(inSigmas(off, batch.smoother.trunkCovariance(id)), 0.3) << j;
  }
}

TEST(Smoother, UpdatesOfAWindowAsLongAsTheFlightReachTheBatchSolve)
{
  FlightOptions o{80};
  const Flight flight = simulateFlight(o);
  SmootherOptions options = smootherFor(o);
  options.window = o.poses;
  options.max_iterations = 20;
  Replay replay(flight, options);

  replay.run();

  DenseReference dense(replay.smoother.graph());
  EXPECT_LT(std::abs(relativeExcess(replay.smoother.cost(), dense.solve())), 1e-5);
}

/// Where the window forgets, what left it is a factor on what stayed.
TEST(Smoother, CostOfAnOptimisationIsThatOfAllFactorsAlsoWhereTheWindowForgets)
{
  FlightOptions o{90};
  const Flight flight = simulateFlight(o);
  for (const bool forgets : {false, true}) {
    SmootherOptions options = smootherFor(o);
    options.window = 30;
    options.forgets = forgets;
    Replay replay(flight, options);
    replay.run();
    const UpdateResult settled = replay.smoother.optimize(1e-10);
    EXPECT_NEAR(settled.cost, replay.smoother.cost(), 1e-6 * std::abs(settled.cost)) << forgets;
    if (forgets) {
      EXPECT_NEAR(replay.smoother.update().cost, settled.cost, 1e-3 * std::abs(settled.cost));
    }
  }
}
} // namespace
