// SPDX-License-Identifier: GPL-2.0-or-later
// A graph whose metre is found late.
#include "smoothing/factors.h"
#include "support/flight.h"

#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
Graph flownGraph()
{
  test::FlightOptions o;
  o.poses = 40;
  const test::Flight flight = test::simulateFlight(o);
  test::Replay replay(flight, test::smootherFor(o));
  replay.run();
  Graph graph = replay.smoother.graph();
  graph.bMc.t << 0.1, -0.05, 0.02; // a lever arm, which keeps its length
  return graph;
}

double costOfPriors(const Graph &graph)
{
  double sum = 0;
  for (const Graph::TrunkVertex &vertex : graph.trunks)
    sum += 0.5 * residual(vertex.prior, vertex.trunk).squaredNorm();
  return sum;
}

TEST(ScaledGraph, ChangesNoResidualButThoseOfTheRadii)
{
  const Graph graph = flownGraph(), larger = scaled(graph, 2.5);
  const double before = cost(graph) - costOfPriors(graph), after = cost(larger) - costOfPriors(larger);
  EXPECT_NEAR(after, before, 0.02 * before); // the lever arm enters the covariance of a step to first order
  EXPECT_GT(costOfPriors(larger), 2 * costOfPriors(graph));
  for (std::size_t i = 0; i < graph.observations.size(); ++i) {
    const auto &edge = graph.observations[i];
    const RelativeTrunk seen = relativeTrunk(graph.poses[edge.pose].wMb, graph.bMc, graph.trunks[edge.trunk].trunk);
    const RelativeTrunk now = relativeTrunk(larger.poses[edge.pose].wMb, graph.bMc, larger.trunks[edge.trunk].trunk);
    EXPECT_LT(now.minus(seen).norm(), 1e-9);
  }
}

TEST(ScaledGraph, ThereAndBackIsTheSame)
{
  const Graph graph = flownGraph(), back = scaled(scaled(graph, 3), 1.0 / 3);
  for (std::size_t i = 0; i < graph.poses.size(); ++i)
    EXPECT_LT(back.poses[i].wMb.minus(graph.poses[i].wMb).norm(), 1e-9);
  for (std::size_t j = 0; j < graph.trunks.size(); ++j)
    EXPECT_LT(back.trunks[j].trunk.minus(graph.trunks[j].trunk).norm(), 1e-9);
  EXPECT_NEAR(cost(back), cost(graph), 1e-6 * cost(graph));
}

TEST(ScaledGraph, AFactorThatIsNoneIsRefused)
{
  EXPECT_THROW(scaled(Graph(), 0), vpException);
  EXPECT_THROW(scaled(Graph(), -1), vpException);
}
} // namespace
} // namespace bole
