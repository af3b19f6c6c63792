// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/forest.h"
#include "simulation/random.h"

#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
std::vector<Eigen::Vector3d> straightPath(double length)
{
  std::vector<Eigen::Vector3d> path;
  for (double x = 0; x <= length; x += 0.1) {
    path.push_back({x, 0, 1.2});
  }
  return path;
}

TEST(Random, SameSeedSameNumbersOtherStreamOtherNumbers)
{
  Random a(7, 1), b(7, 1), c(7, 2);
  int equal = 0;
  for (int k = 0; k < 100; ++k) {
    const std::uint64_t value = a.next();
    EXPECT_EQ(value, b.next());
    equal += value == c.next();
  }
  EXPECT_EQ(equal, 0);
}

TEST(Random, NormalNumbersHaveMeanZeroAndVarianceOne)
{
  Random random(3);
  double sum = 0, squares = 0;
  constexpr int kCount = 40000;
  for (int k = 0; k < kCount; ++k) {
    const double value = random.normal();
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kCount, 0, 0.02);
  EXPECT_NEAR(squares / kCount, 1, 0.03);
}

TEST(Forest, SameSeedSameForest)
{
  ForestOptions options;
  const Forest a = Forest::plant(options, straightPath(10)), b = Forest::plant(options, straightPath(10));
  ASSERT_EQ(a.trunks.size(), b.trunks.size());
  for (std::size_t k = 0; k < a.trunks.size(); ++k) {
    EXPECT_EQ(a.trunks[k].foot, b.trunks[k].foot);
    EXPECT_EQ(a.trunks[k].radius, b.trunks[k].radius);
  }
  options.seed = 2;
  EXPECT_NE(Forest::plant(options, straightPath(10)).trunks.front().foot, a.trunks.front().foot);
}

TEST(Forest, HasTheDensityThatWasAskedFor)
{
  ForestOptions options;
  options.density = 0.05;
  const Forest forest = Forest::plant(options, straightPath(40));
  const double area = (forest.near_max - forest.near_min).prod();
  EXPECT_NEAR(forest.trunks.size() / area, 0.05, 0.002);
}

TEST(Forest, LeavesThePathFree)
{
  ForestOptions options;
  options.density = 0.2;
  options.clearance = 0.9;
  const std::vector<Eigen::Vector3d> path = straightPath(20);
  const Forest forest = Forest::plant(options, path);
  for (const Eigen::Vector3d &point : path) {
    EXPECT_GT(forest.distanceToBark(point),
              0.7); // lean and bow may take something of the clearance
  }
}

TEST(Forest, WantedTrunksComeFirstWithTheirFootOnTheGround)
{
  SimulatedTrunk wanted;
  wanted.foot = {3, 1, 99};
  wanted.radius = 0.33;
  const Forest forest = Forest::plant({}, straightPath(5), {wanted});
  EXPECT_EQ(forest.trunks.front().id, 0);
  EXPECT_DOUBLE_EQ(forest.trunks.front().radius, 0.33);
  EXPECT_DOUBLE_EQ(forest.trunks.front().foot.z(), forest.terrain.height(3, 1));
}

TEST(SimulatedTrunk, HasItsRadiusAtBreastHeight)
{
  SimulatedTrunk trunk;
  trunk.radius = 0.2;
  EXPECT_NEAR(trunk.radiusAt(1.3), 0.2, 1e-4);
  EXPECT_GT(trunk.radiusAt(0), 0.25);
  EXPECT_LT(trunk.radiusAt(6), 0.19);
}

TEST(SimulatedTrunk, CylinderPassesThroughTheAxisWhereADroneLooks)
{
  SimulatedTrunk trunk;
  trunk.foot = {4, -2, 0.3};
  trunk.lean = {0.03, -0.02};
  trunk.bow = {0.05, 0.02};
  const Trunk cylinder = trunk.cylinder();
  EXPECT_NEAR((cylinder.axisAt(0.3 + 0.6) - trunk.axisAt(0.6)).norm(), 0, 1e-12);
  EXPECT_NEAR((cylinder.axisAt(0.3 + 2.0) - trunk.axisAt(2.0)).norm(), 0, 1e-12);
  EXPECT_LT((cylinder.axisAt(0.3 + 1.3) - trunk.axisAt(1.3)).norm(), 0.005);
}

TEST(Terrain, IsFlatAtTheOriginAndSmooth)
{
  const Terrain terrain(5, 0.1);
  EXPECT_NEAR(terrain.height(0, 0), 0, 1e-12);
  for (double x = -20; x < 20; x += 0.37) {
    EXPECT_LT(std::abs(terrain.height(x + 0.01, 2) - terrain.height(x, 2)), 0.01);
  }
}
} // namespace
} // namespace bole
