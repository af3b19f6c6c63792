// SPDX-License-Identifier: GPL-2.0-or-later
#include "obstacles.h"
#include "support/test.h"

#include "tasks/drone_response.h"
#include "tasks/way_planner.h"

using namespace bole;

namespace
{
using test::obstacleAt;

struct Flown
{
  double least = 1e9; ///< hull to bark [m]
  double seconds = 0, x = 0;
};

/// A drone that is late, slow, and obeys by a share, along planned ways.
Flown fly(const std::vector<Obstacle> &trunks, double length, double obeyed = 1)
{
  const WayOptions options;
  const ResponseOptions response;
  PlaneResponse believed(response);
  DroneResponse drone(response);
  Eigen::Vector2d p(0, 0);
  Way way;
  Flown flown;
  for (double t = 0; p.x() < length && t < 120; t += 0.1) {
    believed.see(p, t);
    WayGoal goal;
    goal.x_end = p.x() + 7;
    goal.y_low = -4;
    goal.y_high = 4;
    goal.detour = [](double, double y) { return 0.4 * std::abs(y); };
    way = planWay(trunks, believed.rest(), goal, options, way);
    const Eigen::Vector2d v = way.speed / believed.obeyed() * way.ahead;
    believed.send(v);
    drone.advance(t);
    drone.send(t, {obeyed * v.x(), obeyed * v.y(), 0, 0});
    for (int k = 1; k <= 10; ++k) {
      p += drone.advance(t + 0.01 * k).head<2>();
      for (const Obstacle &trunk : trunks)
        flown.least = std::min(flown.least, trunk.clearance(p, 0) - options.hull);
    }
    flown.seconds = t;
    flown.x = p.x();
  }
  return flown;
}

TEST(WayPlanner, PassesWhatStandsInItsWayAtTheSpeedItMeansAlsoWhereTheDroneObeysByASharePart)
{
  std::vector<Obstacle> line, wall; // the wall has an opening
  for (int k = 0; k < 8; ++k)
    line.push_back(obstacleAt(5 + 4 * k, 0.3 * std::sin(2.0 * k), 0.2));
  for (int k = -12; k <= 12; ++k)
    if (k != 5 && k != 6 && k != 7)
      wall.push_back(obstacleAt(6, 0.5 * k, 0.15));
  struct Case
  {
    std::vector<Obstacle> trunks;
    double length, obeyed, most_s, least;
  };
  for (const Case &c : {Case{{}, 20, 1, 22, 0}, Case{{}, 30, 0.85, 32.5, 0}, Case{line, 38, 1, 50, 0.08},
                        Case{{obstacleAt(4, 0, 0.2)}, 8, 1, 11, 0.08}, Case{wall, 9, 1, 120, 0.05}}) {
    const Flown flown = fly(c.trunks, c.length, c.obeyed);
    EXPECT_GE(flown.x, c.length);
    EXPECT_GT(flown.seconds, c.length - 2) << c.length << " m";
    EXPECT_LT(flown.seconds, c.most_s) << c.length << " m: not by creeping, nor by pondering";
    EXPECT_GT(flown.least, c.least) << c.length << " m";
  }
}

TEST(WayPlanner, StopsBeforeAWallWithoutOpening)
{
  std::vector<Obstacle> trunks;
  for (int k = -30; k <= 30; ++k)
    trunks.push_back(obstacleAt(4, 0.4 * k, 0.2));
  const Flown flown = fly(trunks, 9);
  EXPECT_GT(flown.least, 0);
  EXPECT_LT(flown.x, 4);
}

Way planned(const std::vector<Obstacle> &trunks, const RoomAt &room_at = {}, const Way &last = {})
{
  WayGoal goal;
  goal.x_end = 7;
  goal.y_low = -4;
  goal.y_high = 4;
  goal.detour = [](double, double y) { return 0.4 * std::abs(y); };
  return planWay(trunks, {0, 0}, goal, {}, last, room_at);
}

double widest(const Way &way)
{
  double y = 0;
  for (const Eigen::Vector2d &place : way.places)
    y = std::max(y, std::abs(place.y()));
  return y;
}

TEST(WayPlanner, KeepsFartherFromWhatIsLessWellKnown)
{
  Obstacle sure = obstacleAt(4, 0.1), vague = sure;
  vague.covariance = 0.16 * Eigen::Matrix2d::Identity();
  EXPECT_GT(widest(planned({vague})), widest(planned({sure})) + 0.3);
}

TEST(WayPlanner, GoesRoundWhatWasNotSeenThroughWithItsWholeWidth)
{
  const WayOptions options;
  const Way way = planned( // a corner of what was not seen
      {}, [](double x, double y) { return std::hypot(std::max(1 - x, 0.0), std::max(-0.2 - y, 0.0)); });
  for (const Eigen::Vector2d &place : way.places)
    if (place.x() > 1 && place.norm() < 2.5) {
      EXPECT_LT(place.y(), -0.2 - options.hull) << place.x();
    }
  EXPECT_NEAR(planned({}, [](double, double) { return 1; }).ahead.y(), 0, 1e-9);
}

TEST(WayPlanner, DoesNotFlyFastWhereNothingIsKnown)
{
  const WayOptions options;
  EXPECT_NEAR(planned({}, [](double, double) { return 0; }).speed, options.unseenSpeed(), 1e-9);
  const double half_seen =
      planned({}, [](double x, double y) { return std::max(1 - std::max(x, std::abs(y)), 0.0); }).speed;
  EXPECT_GT(half_seen, options.unseenSpeed() + 0.15);
  EXPECT_LT(half_seen, options.unseenSpeed() + 0.6);
  EXPECT_EQ(planned({}).speed, options.speed);
}

TEST(WayPlanner, KeepsItsSideWhereTheOtherIsHardlyQuicker)
{
  const Way left = planned({obstacleAt(4, -0.05, 0.3)});
  EXPECT_GT(left.lookedAt({0, 0}, 3.5).y(), 0);
  EXPECT_GT(planned({obstacleAt(4, 0.05, 0.3)}, {}, left).lookedAt({0, 0}, 3.5).y(), 0); // it moved in the map
  EXPECT_LT(planned({obstacleAt(4, 0.05, 0.3)}).lookedAt({0, 0}, 3.5).y(), 0);
}

TEST(WayPlanner, KeepsItsSideWhileItMayBeFlownAtMoreThanHalfItsSpeed)
{
  const std::vector<Obstacle> trunk = {obstacleAt(2, -0.05, 0.3)};
  const Way left = planned(trunk);
  const auto side = [&](double room) { // was seen to be free on the left
    return planned(
               trunk, [room](double, double y) { return y > 0.2 ? room : 1; }, left)
        .lookedAt({0, 0}, 2)
        .y();
  };
  const WayOptions options;
  const double room = options.hull + options.free; // and .35 m for a metre a second
  EXPECT_GT(side(room + 0.35 * 0.6), 0);
  EXPECT_LT(side(room + 0.35 * 0.4), 0);
}

TEST(WayPlanner, LeavesWhatItStandsInByTheMap)
{
  const Way way = planned({obstacleAt(0.3, -0.2, 0.1)});
  EXPECT_LT(way.clearance, 0);
  EXPECT_GT(way.ahead.y(), 0.3);
  EXPECT_GT(way.speed, 0.1);
}

TEST(WayPlanner, AWallIsNeverCrossed)
{
  WayGoal goal;
  goal.x_end = 4;
  goal.y_low = -3;
  goal.y_high = 3;
  goal.is_wall = [](double x, double y) { return std::abs(x - 2) < 0.3 && std::abs(y - 1) > 0.4; };
  const Way way = planWay({}, {0, -1}, goal, {}, {});
  EXPECT_TRUE(way.is_open);
  for (const Eigen::Vector2d &place : way.places)
    EXPECT_FALSE(goal.is_wall(place.x(), place.y()));
  goal.is_wall = [](double x, double) { return std::abs(x - 2) < 0.3; };
  EXPECT_FALSE(planWay({}, {0, -1}, goal, {}, {}).is_open);
}
} // namespace
