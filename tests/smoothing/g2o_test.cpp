// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/flight.h"

#include <bole/graph.h>

#include <cmath>
#include <filesystem>
#include <gmock/gmock.h>
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

TEST(G2o, APoseOrATrunkThatIsNotFiniteIsNoGraph)
{
  const auto error = [](const Graph &graph) -> std::string {
    try {
      Smoother smoother(graph, SmootherOptions());
    }
    catch (const vpException &e) {
      return e.what();
    }
    return "none";
  };
  Graph pose = smallGraph(), trunk = pose;
  pose.poses[4].wMb.t.x() = std::nan("");
  EXPECT_THAT(error(pose), HasSubstr("pose 4"));
  trunk.trunks[1].trunk.xy.y() = INFINITY;
  EXPECT_THAT(error(trunk), HasSubstr("trunk 1"));
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

TEST(G2o, NamesTheLineOfAPoseThatIsNotTiedToTheWorld)
{
  const std::string second = "VERTEX_SE3:QUAT 5 1 0 0 0 0 0 1\n";
  EXPECT_THAT(errorOf(kPose), HasSubstr("file.g2o:1: pose 0, must be tied to the world"));
  EXPECT_THAT(errorOf(std::string(kPose) + kPrior + second),
              HasSubstr("file.g2o:3: pose 5, must be tied to the world"));
  EXPECT_EQ(errorOf(std::string(kPose) + kPrior), "none");
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
