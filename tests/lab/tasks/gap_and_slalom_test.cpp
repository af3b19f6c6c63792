// SPDX-License-Identifier: GPL-2.0-or-later
#include "obstacles.h"
#include "support/test.h"

#include "tasks/gap_and_slalom.h"

using namespace bole;

namespace
{
using test::obstacleAt;

TEST(Obstacle, CountsItsCovarianceInTheDirectionAsked)
{
  Obstacle trunk = obstacleAt(0, 0, 0.2, 0);
  trunk.covariance << 0.09, 0, 0, 0.01;
  EXPECT_NEAR(trunk.clearance({2, 0}, 0), 1.8, 1e-12);
  EXPECT_NEAR(trunk.clearance({2, 0}, 2), 1.8 - 0.6, 1e-12);
  EXPECT_NEAR(trunk.clearance({0, 2}, 2), 1.8 - 0.2, 1e-12);
}

TEST(NearPoints, WhatStandsUprightCountsAndWhatLiesLowDoesNot)
{
  const Pose wMb(Eigen::Matrix3d::Identity(), {0, 0, 1.2});
  NearPoints near;
  for (int k = 0; k < 4; ++k) // in a frame each: bark, a bush, a crown over the drone
    near.see({{1.03, 0.02, 0.6 + 0.3 * k},
              {1.03, 0.02, 1.2},
              {1.03, 1.02, 0.5 + 0.02 * k},
              {1.03, 1.02, 0.5},
              {1.03, -1.02, 3.0}},
             wMb, 0.1 * k);
  std::vector<Obstacle> found;
  near.addTo(found, wMb, 2);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR((found[0].xy - Eigen::Vector2d(1.03, 0.02)).norm(), 0, 1e-9);
  EXPECT_GT(found[0].evidence, 10);
  found.clear();
  near.addTo(found, wMb, 0.9);
  EXPECT_TRUE(found.empty());
  near.see({}, wMb, 10); // long after
  near.addTo(found, wMb, 2);
  EXPECT_TRUE(found.empty());
}

TEST(SeenSpace, IsWhatPointsWereSeenThroughAndNotWhatHidesThem)
{
  const Eigen::Vector3d from(-20.3, 7.1, 1.2); // the map of cells goes round
  const auto ray = [](double degrees, double slope) {
    const double a = degrees * M_PI / 180;
    return Eigen::Vector3d(std::cos(a), std::sin(a), slope).normalized();
  };
  std::vector<TriangulatedRay> sights;
  for (double degrees = -30; degrees <= 30; degrees += 0.25)
    sights.push_back({ray(degrees, 0), std::abs(degrees) < 8 ? 1 / 1.5 : 1 / 9.0, 0.01}); // a wide thing 1.5 m ahead
  SeenSpace space;
  for (int k = 0; k < 10; ++k)
    space.see(sights, from, 0.1 * k);
  space.stand(from.head<2>());
  const auto isSeen = [&](double degrees, double range) {
    return space.roomAt(from.head<2>() + range * ray(degrees, 0).head<2>()) > 0;
  };
  EXPECT_TRUE(isSeen(0, 1.0));
  EXPECT_FALSE(isSeen(0, 1.5)); // its bark
  EXPECT_FALSE(isSeen(0, 2.5)); // and behind it
  EXPECT_TRUE(isSeen(20, 2.5));
  EXPECT_FALSE(isSeen(50, 1.5)); // beside the image
  space.see({}, from, 30);       // long after
  space.stand(from.head<2>());
  EXPECT_FALSE(isSeen(20, 2.5));
}

TEST(SeenSpace, RaysToTheGroundTellOfTheHeightOfTheDroneOnly)
{
  std::vector<TriangulatedRay> sights;
  for (int k = 0; k < 200; ++k)
    sights.push_back({Eigen::Vector3d(1, 0, -0.5).normalized(), 1 / 6.0, 0.01});
  SeenSpace space;
  space.see(sights, {0.05, 0.05, 1.2}, 0); // along the middles of the cells
  space.stand({0.05, 0.05});
  EXPECT_GT(space.roomAt({0.75, 0.05}), 0);
  EXPECT_EQ(space.roomAt({1.75, 0.05}), 0); // the ray is 0.85 m below it there
}

TEST(SeenSpace, ABodyFitsAsFarAsAllRoundThePlaceWasSeen)
{
  SeenSpace space; // a lane 0.8 m wide ahead
  for (int k = 0; k < 4; ++k)
    for (double y = -0.4; y <= 0.4; y += 0.01)
      space.see({{Eigen::Vector3d(1, 0, 0), 1 / 8.0, 0.01}}, {0, y, 1.2}, 0);
  space.stand({0, 0});
  for (const double x : {1.0, 2.0, 3.0}) {
    EXPECT_NEAR(space.roomAt({x, 0.05}), 0.35, 0.06);
    EXPECT_NEAR(space.roomAt({x, 0.25}), 0.15, 0.06);
    EXPECT_EQ(space.roomAt({x, 0.55}), 0);
  }
  EXPECT_EQ(space.roomAt({0, 30}), 0);
}

TEST(SeenSpace, RaysThatPassATrunkOnBothSidesDoNotPassThroughIt)
{
  constexpr double kRadius = 0.1;
  for (double x = 2; x < 2.1; x += 0.02)
    for (double y = 0; y < 0.1; y += 0.02) {
      SeenSpace space; // a wide look at it from two places; it has no points of its own
      for (const double left : {-0.4, 0.0, 0.4}) {
        std::vector<TriangulatedRay> sights;
        for (double a = -0.6; a < 0.6; a += 0.002) {
          const Eigen::Vector3d ray(std::cos(a), std::sin(a), 0);
          if (std::abs(x * ray.y() - (y - left) * ray.x()) > kRadius)
            sights.push_back({ray, 1 / 8.0, 0.001});
        }
        space.see(sights, {0, left, 1.2}, 0);
      }
      space.stand({0, 0});
      EXPECT_LT(space.roomAt({x, y}), 0.1) << x << " " << y;
      EXPECT_GT(space.roomAt({x, y - 0.5}), 0.1) << x << " " << y;
    }
}

TEST(Gap, MiddleIsThatOfTheFreeWidth)
{
  const Gap gap = gapBetween(obstacleAt(5, -1, 0.3, 4), obstacleAt(5, 1, 0.1, 7), {0, 0});
  EXPECT_NEAR(gap.width, 1.6, 1e-12);
  EXPECT_NEAR(gap.middle.y(), 0.1, 1e-12);
  EXPECT_NEAR(gap.along.x(), 1, 1e-12);
  EXPECT_EQ(gap.left, 7);
  EXPECT_EQ(gap.right, 4);
  const Gap from_behind = gapBetween(obstacleAt(5, -1, 0.3, 4), obstacleAt(5, 1, 0.1, 7), {10, 0});
  EXPECT_NEAR(from_behind.along.x(), -1, 1e-12);
  EXPECT_EQ(from_behind.left, 4);
}

TEST(Gap, ChoosesTheOneNearestToStraightAhead)
{
  const std::vector<Obstacle> trunks{obstacleAt(5, 1, 0.15, 0), obstacleAt(5, -0.8, 0.15, 1),
                                     obstacleAt(5, -2.8, 0.15, 2)};
  const auto gap = chooseGap(trunks, {0, 0}, 0, 0, {});
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap->left, 0);
  EXPECT_EQ(gap->right, 1);
  const auto to_the_right = chooseGap(trunks, {0, 0}, -0.35, 0, {});
  ASSERT_TRUE(to_the_right);
  EXPECT_EQ(to_the_right->right, 2);
}

TEST(Gap, IsNotChosenWhereItIsNarrowUnconfirmedOrBlocked)
{
  const std::vector<Obstacle> open{obstacleAt(5, 0.8, 0.15, 0), obstacleAt(5, -0.8, 0.15, 1)};
  ASSERT_TRUE(chooseGap(open, {0, 0}, 0, 0, {}));
  EXPECT_FALSE(chooseGap({obstacleAt(5, 0.6, 0.15, 0), obstacleAt(5, -0.6, 0.15, 1)}, {0, 0}, 0, 0, {})); // 0.9 m
  auto doubtful = open;
  doubtful[0].evidence = 3;
  doubtful[1].evidence = 1;
  EXPECT_FALSE(chooseGap(doubtful, {0, 0}, 0, 1.5, {}));
  EXPECT_TRUE(chooseGap(doubtful, {0, 0}, 0, 0.5, {}));
  doubtful[0].is_confirmed = false;
  EXPECT_FALSE(chooseGap(doubtful, {0, 0}, 0, 0, {}));
  auto blocked = open;
  blocked.push_back(obstacleAt(6.2, 0.1, 0.15, 2));
  EXPECT_FALSE(chooseGap(blocked, {0, 0}, 0, 0, {}));
}

TEST(Slalom, LooksFromBothSidesBeforeItLeaves)
{
  SlalomTaskOptions options;
  options.look = 4;
  SlalomTask task(options);
  FrameReport report; // of a drone that obeys at once
  double left = 0, right = 0;
  for (int k = 0; k < 60; ++k) {
    const double t = 0.1 * k;
    report.stamp_ns = k * 100000000LL;
    const TaskCommand command = task.step(report);
    ASSERT_FALSE(command.is_hovering);
    EXPECT_EQ(task.phase(), t < 4 ? TaskPhase::searching : TaskPhase::servoing) << t;
    EXPECT_EQ(command.velocity.x() > 0.1, t >= 4) << t; // slowly: it sees nothing
    report.wMb.t += 0.1 * command.velocity.head<3>();
    left = std::max(left, t < 4 ? report.wMb.t.y() : 0);
    right = std::min(right, t < 4 ? report.wMb.t.y() : 0);
  }
  EXPECT_GT(left, 0.35);
  EXPECT_LT(right, -0.35);
}
} // namespace
