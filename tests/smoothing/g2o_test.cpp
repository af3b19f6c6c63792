// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/flight.h"

#include <bole/graph.h>
#include <clocale>

#include <cmath>
#include <filesystem>
#include <functional>
#include <gmock/gmock.h>
#include <limits>
#include <sstream>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
using testing::HasSubstr;

const char *const kPose = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";
const char *const kPrior = "EDGE_SE3_PRIOR:QUAT 0 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";

std::string errorOf(const std::string &text)
{
  std::istringstream in(text);
  try {
    readG2o(in, "file.g2o");
  }
  catch (const vpException &error) {
    return error.what();
  }
  return "none";
}

Graph smallGraph()
{
  test::FlightOptions o;
  o.poses = 12;
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

TEST(G2o, WritesAFileAndLeavesNoOther)
{
  const std::string folder = testing::TempDir() + "g2o_file", path = folder + "/graph.g2o";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directory(folder);
  const Graph graph = smallGraph();

  writeG2o(path, graph);

  EXPECT_EQ(readG2o(path).poses.size(), graph.poses.size());
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
  EXPECT_THROW(writeG2o(folder + "/none/graph.g2o", graph), vpException);
}

/// What no solver may be given, one thing at a time, and the name that the message must give it.
TEST(G2o, WhatIsNoGraphIsNamed)
{
  const Graph good = smallGraph();
  const auto error = [&](const std::function<void(Graph &)> &spoil) -> std::string {
    Graph graph = good;
    spoil(graph);
    try {
      Smoother smoother(graph, SmootherOptions());
    }
    catch (const vpException &e) {
      return e.what();
    }
    return "none";
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(error([](Graph &) {}), "none");
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

TEST(G2o, ReplaysToTheSameOptimum)
{
  const Graph graph = smallGraph();
  std::stringstream text;
  writeG2o(text, graph);
  Smoother here(graph, SmootherOptions()), there(readG2o(text, "text"), SmootherOptions());

  here.optimize();
  there.optimize();

  EXPECT_NEAR(here.cost(), there.cost(), 1e-7 * here.cost());
}

TEST(G2o, NamesTheLineOfAnUnknownTag)
{
  EXPECT_THAT(errorOf(std::string(kPose) + "VERTEX_CAR 1 2\n"), HasSubstr("file.g2o:2: tag = VERTEX_CAR"));
}

TEST(G2o, NamesTheLineOfADuplicateId)
{
  EXPECT_THAT(errorOf(std::string(kPose) + kPose), HasSubstr("file.g2o:2: id = 0, must not be that of line 1"));
}

TEST(G2o, NamesTheLineOfNaN)
{
  EXPECT_THAT(errorOf("VERTEX_SE3:QUAT 0 nan 0 0 0 0 0 1\n"), HasSubstr("file.g2o:1: VERTEX_SE3:QUAT: 2 = nan"));
}

TEST(G2o, NamesTheLineOfAnEdgeWithoutItsVertex)
{
  std::string other = kPrior;
  other.replace(other.find(" 0"), 2, " 7");
  EXPECT_THAT(errorOf(std::string(kPose) + kPrior + other), HasSubstr("file.g2o:3: id = 7"));
}

TEST(G2o, NamesTheLineOfAShortLine)
{
  EXPECT_THAT(errorOf("VERTEX_SE3:QUAT 0 0 0\n"), HasSubstr("file.g2o:1: VERTEX_SE3:QUAT: the line ends"));
}

TEST(G2o, NamesTheLineOfAnIndefiniteSummary)
{
  const std::string trunk = "VERTEX_TRUNK 1 3 0 -2 0 0 3 0 -2 0 0 9 9 1 1 1\n";
  const std::string edge = "EDGE_TRUNK_SUMMARY 0 1 0 0 0 1 -3 0 0 0 0 0 1 0 0 0 1 0 0 1 0 -1\n";
  EXPECT_THAT(errorOf(kPose + trunk + edge), HasSubstr("file.g2o:3: EDGE_TRUNK_SUMMARY: F"));
}

Graph graphOf(const std::string &text)
{
  std::istringstream in(text);
  return readG2o(in, "file.g2o");
}

TEST(G2o, NamesTheLineOfAPoseThatIsNotTiedToTheWorld)
{
  const std::string second = "VERTEX_SE3:QUAT 5 1 0 0 0 0 0 1\n";
  EXPECT_THAT(errorOf(std::string(kPose) + kPrior + second),
              HasSubstr("file.g2o:3: pose 5, must be tied to the world"));
  EXPECT_THAT(errorOf(kPose + second), HasSubstr("file.g2o:2: pose 5, must be tied to the world"));
  EXPECT_EQ(errorOf(std::string(kPose) + kPrior), "none");
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
  EXPECT_THAT(errorOf("FIX 7\n" + std::string(kPose)), HasSubstr("file.g2o:1: id = 7"));
}

TEST(G2o, RefusesAFileWithoutAPose)
{
  for (const char *text : {"", "\n\n", "# nothing\n", "LOSS summary huber 3\n"})
    EXPECT_THAT(errorOf(text), HasSubstr("file.g2o: no pose")) << text;
  EXPECT_THROW(readG2o(std::string("/dev/null")), vpException);
  EXPECT_THROW(readG2o(testing::TempDir()), vpException);
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

TEST(G2o, NumbersDoNotDependOnTheLocale)
{
  const char *const before = std::setlocale(LC_NUMERIC, nullptr);
  const std::string old = before ? before : "C";
  if (!std::setlocale(LC_NUMERIC, "de_DE.UTF-8"))
    GTEST_SKIP() << "no locale with a comma is installed";
  const Graph graph = graphOf("VERTEX_SE3:QUAT 0 0.5 0 0 0 0 0 1\n");
  std::setlocale(LC_NUMERIC, old.c_str());
  EXPECT_EQ(graph.poses[0].wMb.t.x(), 0.5);
}

TEST(G2o, NamesTheLineOfAnInformationMatrixThatIsNone)
{
  const std::string indefinite = "EDGE_SE3_PRIOR:QUAT 0 0 0 0 0 0 0 1 -1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  const std::string huge = "EDGE_SE3_PRIOR:QUAT 0 0 0 0 0 0 0 1 1e308 0 0 0 0 0 1e-308 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  EXPECT_THAT(errorOf(kPose + indefinite), HasSubstr("file.g2o:2: EDGE_SE3_PRIOR:QUAT: matrix"));
  EXPECT_THAT(errorOf(kPose + huge), HasSubstr("file.g2o:2: EDGE_SE3_PRIOR:QUAT: matrix"));
}

TEST(G2o, NamesTheLineOfAnIdBeyondItsRange)
{
  EXPECT_THAT(errorOf("VERTEX_SE3:QUAT 99999999999999999999 0 0 0 0 0 0 1\n"),
              HasSubstr("file.g2o:1: VERTEX_SE3:QUAT: id = 99999999999999999999"));
}

TEST(G2o, NamesTheLineOfARadiusThatIsNone)
{
  EXPECT_THAT(errorOf("VERTEX_TRUNK 1 3 0 999 0 0 3 0 -2 0 0 9 9 1 1 1\n"),
              HasSubstr("file.g2o:1: VERTEX_TRUNK: log_r = 999"));
}
} // namespace
} // namespace bole
