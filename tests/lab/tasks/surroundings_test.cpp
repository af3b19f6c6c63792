// SPDX-License-Identifier: GPL-2.0-or-later
#include "obstacles.h"
#include "support/test.h"

using namespace bole;

namespace
{
using test::obstacleAt;

/// All within 6 m was seen to be free, all round.
Surroundings clearing()
{
  FrameReport report;
  for (double a = 0; a < 2 * M_PI; a += 0.01)
    report.points.push_back({{std::cos(a), std::sin(a), 0}, 1 / 8.0, 0.001});
  Surroundings around;
  for (int k = 0; k < 12; ++k)
    around.see(report);
  return around;
}

Eigen::Vector2d safe(const Eigen::Vector2d &velocity, const Eigen::Vector2d &p, const std::vector<Obstacle> &surfaces)
{
  return safeVelocity(velocity, p, p, surfaces, clearing(), {});
}

TEST(SafeVelocity, ADroneThatFliesStraightAtATrunkStopsBeforeIt)
{
  const SafetyOptions options;
  const std::vector<Obstacle> trunks{obstacleAt(3, 0, 0.2)};
  const Surroundings around = clearing();
  Eigen::Vector2d p(0, 0), v(0, 0);
  for (int k = 0; k < 1000; ++k) { // obeys with a lag of 0.5 s
    v += 0.02 / 0.5 * (safeVelocity({1, 0}, p, p + 0.5 * v, trunks, around, options) - v);
    p += 0.02 * v;
    ASSERT_GT((trunks[0].xy - p).norm(), 0.2 + options.hull + options.least_free - 0.01) << "after " << k << " steps";
  }
  EXPECT_LT((trunks[0].xy - p).norm(), 0.2 + options.hull + options.least_free + 0.05);
}

TEST(SafeVelocity, AWayThatLeadsPastOrAwayOrToWhatIsNoTrunkYetStaysAsItIs)
{
  std::vector<Obstacle> trunks{obstacleAt(2, 1.5, 0.2)};
  EXPECT_NEAR((safe({0.6, 0}, {2, 0}, trunks) - Eigen::Vector2d(0.6, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((safe({0, -0.6}, {2, 1.0}, trunks) - Eigen::Vector2d(0, -0.6)).norm(), 0, 1e-12);
  trunks[0].is_confirmed = false;
  EXPECT_NEAR((safe({0, 0.6}, {2, 1.0}, trunks) - Eigen::Vector2d(0, 0.6)).norm(), 0, 1e-12);
}

TEST(SafeVelocity, NeitherADoubtfulNorANearTrunkPushesTheDroneAway)
{
  std::vector<Obstacle> trunks{obstacleAt(2, 0.4, 0.2)}; // nearer than the hull allows
  EXPECT_NEAR(safe({0.6, 0}, {2, 0}, trunks).y(), 0, 1e-12);
  EXPECT_NEAR(safe({0, 0.3}, {2, 0}, trunks).norm(), 0, 1e-12);
  trunks[0].evidence = -0.5;
  EXPECT_NEAR(safe({0, 0.3}, {2, 0}, trunks).y(), 0.3, 1e-12);
}

TEST(SafeVelocity, TheMiddleOfANarrowGapIsPassedAtFullSpeed)
{
  const std::vector<Obstacle> trunks{obstacleAt(3, 0.75, 0.15), obstacleAt(3, -0.75, 0.15)}; // 1.2 m free
  for (double x = 0; x < 5; x += 0.05) {
    const Eigen::Vector2d v = safe({0.6, 0}, {x, 0}, trunks);
    EXPECT_GT(v.x(), 0.4) << x;
    EXPECT_NEAR(v.y(), 0, 0.05) << x;
  }
}

TEST(SafeVelocity, IntoWhatWasNotSeenItFliesNoFasterThanABumpAllows)
{
  const SafetyOptions options;
  const Surroundings around = clearing();
  EXPECT_NEAR(safeVelocity({1, 0}, {0, 0}, {0, 0}, {}, around, options).norm(), 1, 1e-9);
  EXPECT_NEAR(safeVelocity({1, 0}, {12, 0}, {12, 0}, {}, around, options).norm(), options.unseen_speed,
              0.15 * options.unseen_speed);
  EXPECT_NEAR(safeVelocity({0.4, 0}, {12, 0}, {12, 0}, {}, around, options).norm(), 0.4, 1e-9);
}

TEST(SafeVelocity, WhereNotItsWholeWidthWasSeenToBeFreeItFliesNoFasterThanABumpAllows)
{
  const SafetyOptions options;
  for (const double half : {0.2, 0.9}) { // of a lane ahead
    Surroundings around;
    FrameReport report;
    report.points.push_back({{1, 0, 0}, 1 / 8.0, 0.001});
    for (int k = 0; k < 6; ++k)
      for (double y = -half; y <= half; y += 0.02) {
        report.wMc.t = {0, y, 1.2};
        around.see(report);
      }
    const double speed = safeVelocity({1, 0}, {1, 0}, {1, 0}, {}, around, options).norm();
    EXPECT_NEAR(speed, half > options.hull + options.least_free ? 1 : options.unseen_speed, 1e-9) << half;
  }
}

TEST(SafeVelocity, ItSlowsDownInTimeBeforeWhatWasNotSeen)
{
  const SafetyOptions options;
  const Surroundings around = clearing();
  double x = 0, v = 0;
  for (int k = 0; k < 2000; ++k) {
    v += 0.02 / 0.5 * (safeVelocity({1.5, 0}, {x, 0}, {x + 0.5 * v, 0}, {}, around, options).x() - v);
    x += 0.02 * v;
    if (x > 6.2) { // the end of what was seen, to a cell
      ASSERT_LT(v, options.unseen_speed + 0.1);
    }
  }
  EXPECT_GT(x, 10);
}

TEST(Surroundings, WhereTheDroneHasBeenIsFree)
{
  Surroundings around;
  FrameReport report;
  for (int k = 0; k <= 20; ++k) {
    report.stamp_ns = k * 100000000LL;
    report.wMb.t = {0, 0.05 * k, 1.2};
    around.see(report);
  }
  EXPECT_GT(around.roomAt({0, 0.3}), 0.2); // no more than its hull
  EXPECT_EQ(around.roomAt({0, 1.7}), 0);
}
} // namespace
