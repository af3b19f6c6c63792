// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/flight.h"
#include "support/test.h"

#include "smoothing/factors.h"
#include <bole/graph.h>

using namespace bole;

namespace
{
using testing::HasSubstr;

const char *const kPose = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";
const char *const kPrior = "EDGE_SE3_PRIOR:QUAT 0 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";

std::string errorOf(const std::string &text)
{
  std::istringstream in(text);
  return test::messageOf([&] { readG2o(in, "file.g2o"); });
}

Graph smallGraph()
{
  test::FlightOptions o{12};
  const test::Flight flight = test::simulateFlight(o);
  test::Replay replay(flight, test::smootherFor(o));
  replay.run();
  RelativePoseMeasurement direction;
  direction.covariance *= 1e-4;
  direction.direction = Eigen::Vector3d(0.6, 0, 0.8);
  replay.smoother.addRelativePose(2, 3, direction);
  return replay.smoother.graph();
}

TEST(G2o, ReadsBackWhatItWrote)
{
  const Graph graph = smallGraph();
  std::stringstream text;
  writeG2o(text, graph);

  const Graph back = readG2o(text, "text");

  EXPECT_EQ(back.poses.size(), graph.poses.size());
  EXPECT_EQ(back.trunks.size(), graph.trunks.size());
  EXPECT_EQ(back.observations.size(), graph.observations.size());
  EXPECT_EQ(back.relative_poses.size(), 1u);
  EXPECT_NEAR(cost(back), cost(graph), 1e-9 * cost(graph));
  for (std::size_t i = 0; i < graph.odometry.size(); ++i)
    EXPECT_TRUE(back.odometry[i].odometry.covariance.isApprox(graph.odometry[i].odometry.covariance, 1e-9));
}

/// What no solver may be given, one thing at a time, and the name that the message must give it.
TEST(G2o, WhatIsNoGraphIsNamed)
{
  const Graph good = smallGraph();
  const auto error = [&](const std::function<void(Graph &)> &spoil) {
    Graph graph = good;
    spoil(graph);
    return test::messageOf([&] { Smoother smoother(graph, SmootherOptions()); });
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(error([](Graph &) {}), "");
  const std::size_t poses = good.poses.size(), trunks = good.trunks.size();
  const std::vector<std::pair<std::string, std::function<void(Graph &)>>> spoilt = {
      {"pose 4", [](Graph &g) { g.poses[4].wMb.t.x() = kNaN; }},
      {"trunk 1", [](Graph &g) { g.trunks[1].trunk.xy.y() = kInfinite; }},
      {"trunk 1", [](Graph &g) { g.trunks[1].prior.mean.lean.x() = kNaN; }},
      {"trunk 1: radius", [](Graph &g) { g.trunks[1].trunk.log_radius = 800; }},
      {"trunk 1: radius", [](Graph &g) { g.trunks[1].prior.mean.log_radius = -800; }},
      {"trunk 0: sigmas", [](Graph &g) { g.trunks[0].prior.sigma(3) = 0; }},
      {"trunk 0: sigmas", [](Graph &g) { g.trunks[0].prior.sigma(2) = kInfinite; }},
      {"pose prior 0", [=](Graph &g) { g.pose_priors[0].pose = poses; }},
      {"pose prior 0", [](Graph &g) { g.pose_priors[0].prior.mean.t.z() = kNaN; }},
      {"pose prior covariance", [](Graph &g) { g.pose_priors[0].prior.covariance(2, 2) = -1; }},
      {"odometry 3", [=](Graph &g) { g.odometry[3].a = poses; }},
      {"odometry 3", [=](Graph &g) { g.odometry[3].b = poses; }},
      {"odometry 3", [](Graph &g) { g.odometry[3].b = g.odometry[3].a; }},
      {"odometry 3", [](Graph &g) { g.odometry[3].odometry.aMb.t.x() = kInfinite; }},
      {"odometry covariance", [](Graph &g) { g.odometry[3].odometry.covariance(0, 1) = 9; }},
      {"relative pose 0", [=](Graph &g) { g.relative_poses[0].a = poses; }},
      {"relative pose 0", [=](Graph &g) { g.relative_poses[0].b = poses; }},
      {"relative pose 0", [](Graph &g) { g.relative_poses[0].b = g.relative_poses[0].a; }},
      {"relative pose 0", [](Graph &g) { g.relative_poses[0].measurement.caRcb(0, 0) = kNaN; }},
      {"relative pose 0", [](Graph &g) { g.relative_poses[0].measurement.direction *= 1.01; }},
      {"relative pose covariance", [](Graph &g) { g.relative_poses[0].measurement.covariance.setZero(); }},
      {"observation 2", [=](Graph &g) { g.observations[2].pose = poses; }},
      {"observation 2", [=](Graph &g) { g.observations[2].trunk = trunks; }},
      {"observation 2: F", [](Graph &g) { g.observations[2].summary.F(0, 0) = -1e9; }},
      {"observation 2", [](Graph &g) { g.observations[2].summary.f(1) = kNaN; }},
      {"must be tied", [](Graph &g) { g.odometry.erase(g.odometry.begin() + 5); }},
  };
  for (std::size_t i = 0; i < spoilt.size(); ++i)
    EXPECT_THAT(error(spoilt[i].second), HasSubstr(spoilt[i].first)) << i;
}

/// What no reader may take, and what it says of it.
TEST(G2o, NamesTheLineOfAMistake)
{
  const std::string pose = kPose, prior = kPrior, second = "VERTEX_SE3:QUAT 5 1 0 0 0 0 0 1\n";
  const std::string trunk = "VERTEX_TRUNK 1 3 0 -2 0 0 3 0 -2 0 0 9 9 1 1 1\n",
                    at = "EDGE_SE3_PRIOR:QUAT 0 0 0 0 0 0 0 1 ";
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {pose + "VERTEX_CAR 1 2\n", ":2: tag = VERTEX_CAR"},
      {pose + pose, ":2: id = 0, must not be that of line 1"},
      {"VERTEX_SE3:QUAT 0 nan 0 0 0 0 0 1\n", ":1: VERTEX_SE3:QUAT: 2 = nan, must be a finite number"},
      {"VERTEX_SE3:QUAT 0 0 0\n", ":1: VERTEX_SE3:QUAT: the line ends"},
      {"VERTEX_SE3:QUAT 99999999999999999999 0 0 0 0 0 0 1\n", ":1: VERTEX_SE3:QUAT: id = 99999999999999999999"},
      {"VERTEX_TRUNK 1 3 0 999 0 0 3 0 -2 0 0 9 9 1 1 1\n", ":1: VERTEX_TRUNK: log_r = 999"},
      {pose + prior + "EDGE_SE3_PRIOR:QUAT 7" + prior.substr(at.find(" 0 ") + 2), ":3: id = 7"},
      {pose + at + "-1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n", ":2: EDGE_SE3_PRIOR:QUAT: matrix"},
      {pose + at + "1e308 0 0 0 0 0 1e-308 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n", ":2: EDGE_SE3_PRIOR:QUAT: matrix"},
      {pose + trunk + "EDGE_TRUNK_SUMMARY 0 1 0 0 0 1 -3 0 0 0 0 0 1 0 0 0 1 0 0 1 0 -1\n",
       ":3: EDGE_TRUNK_SUMMARY: F, must be positive semi-definite"},
      {pose + prior + second, ":3: pose 5, must be tied to the world"},
      {pose + second, ":2: pose 5, must be tied to the world"},
      {"FIX 7\n" + pose, ":1: id = 7"},
      {"", ": no pose"},
      {"\n# nothing\n", ": no pose"},
      {"LOSS summary huber 3\n", ": no pose"}};
  for (const auto &[text, says] : mistakes)
    EXPECT_THAT(errorOf(text), HasSubstr("file.g2o" + says)) << text;
  EXPECT_EQ(errorOf(pose + prior), "");
  EXPECT_THROW(readG2o(std::string("/dev/null")), vpException);
  EXPECT_THROW(readG2o(testing::TempDir()), vpException);
}

Graph graphOf(const std::string &text)
{
  std::istringstream in(text);
  return readG2o(in, "file.g2o");
}

TEST(G2o, WithoutAPriorTheFirstPoseIsHeldAndTheReaderSaysSo)
{
  const Graph graph = graphOf(kPose);
  ASSERT_EQ(graph.pose_priors.size(), 1u);
  EXPECT_THAT(graph.assumed, HasSubstr("pose 0 stays where it is"));
  EXPECT_EQ(graphOf(std::string(kPose) + kPrior).assumed, "");
  const Graph fixed = graphOf("FIX 0\n" + std::string(kPose));
  EXPECT_EQ(fixed.assumed, "");
  ASSERT_EQ(fixed.pose_priors.size(), 1u);
  EXPECT_LT(fixed.pose_priors[0].prior.covariance.norm(), 1e-11);
}

TEST(G2o, ReadsPosesInThePlane)
{
  Graph graph = graphOf("\xEF\xBB\xBFVERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 +1.0 0.1 1.5\n"
                        "EDGE_SE2 0 1 1 0 1.57 100 0 0 100 0 400\n");
  ASSERT_EQ(graph.poses.size(), 2u);
  EXPECT_NEAR(graph.poses[1].wMb.R(1, 0), std::sin(1.5), 1e-12);
  EXPECT_NEAR(cost(graph), 0.5 * (100 * 0.1 * 0.1 + 400 * 0.07 * 0.07), 1e-9); // that of g2o's own error
  Smoother smoother(graph, SmootherOptions());
  smoother.optimize();
  EXPECT_NEAR(smoother.cost(), 0, 1e-9);
  EXPECT_NEAR(smoother.pose(1).t.z(), 0, 1e-9);
}

TEST(G2o, ReadsThePriorOfWhatAPoseCarries)
{
  const std::string rest = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 4 0 0 4 0 4\n";
  const Graph graph =
      graphOf(std::string("PARAMS_SE3OFFSET 3 0 0 2 0 0 0 1\n") + kPose + "EDGE_SE3_PRIOR 0 3 5 0 2 0 0 0 1" + rest);
  ASSERT_EQ(graph.pose_priors.size(), 1u);
  EXPECT_LT((graph.pose_priors[0].prior.mean.t - Eigen::Vector3d(5, 0, 0)).norm(), 1e-12);
  EXPECT_NEAR(graph.pose_priors[0].prior.covariance(0, 0), 5, 1e-9) << "a turn of a radian moves it by the offset";
  EXPECT_THAT(errorOf(kPose + ("EDGE_SE3_PRIOR 0 3 5 0 2 0 0 0 1" + rest)),
              HasSubstr("file.g2o:2: EDGE_SE3_PRIOR: parameter 3"));
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
  Graph graph = smallGraph();
  graph.bMc.t << 0.1, -0.05, 0.02; // a lever arm, which keeps its length
  const Graph larger = scaled(graph, 2.5);
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

TEST(ScaledGraph, AFactorThatIsNoneIsRefused)
{
  EXPECT_THROW(scaled(Graph(), 0), vpException);
  EXPECT_THROW(scaled(Graph(), -1), vpException);
}
} // namespace
