// SPDX-License-Identifier: GPL-2.0-or-later
// The plane of the ground, from points drawn on it, on bushes and at random.
#include "support/test.h"

#include "pipeline/ground.h"

namespace
{
using namespace bole;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// A flight of 8 m at 1.4 m over a plane that rises by \p slope, with 12 points in each frame of which a share of
/// \p bushes stands up to 1.5 m above it; the first plane that is known is at \p z.
GroundPlane planeAfterFlight(const Vector2d &slope, double z, double bushes, unsigned seed = 1)
{
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> part(0, 1);
  std::normal_distribution<double> noise;
  GroundFilter filter;
  GroundPlane plane;
  for (int frame = 0; frame < 80; ++frame) {
    const Vector2d at(0.1 * frame, 0.3 * std::sin(0.1 * frame));
    const Vector3d camera(at.x(), at.y(), z + slope.dot(at) + 1.4);
    std::vector<TriangulatedRay> points;
    for (int i = 0; i < 12; ++i) {
      const double bearing = 1.2 * (part(random) - 0.5), distance = 2 + 5 * part(random);
      Vector3d point(at.x() + distance * std::cos(bearing), at.y() + distance * std::sin(bearing), 0);
      point.z() = z + slope.dot(point.head<2>()) + (part(random) < bushes ? 1.5 * part(random) : 0.0);
      const Vector3d to = point - camera;
      const double sigma = 0.05 / to.norm();
      points.push_back({to.normalized(), 1 / to.norm() + sigma * noise(random), sigma});
    }
    plane = filter.add(points, camera);
  }
  return plane;
}

TEST(Ground, ItsPlaneIsFoundWhateverItsInclination)
{
  for (const Vector2d &slope : {Vector2d(0, 0), Vector2d(0.27, 0), Vector2d(-0.2, 0.1)}) {
    const GroundPlane plane = planeAfterFlight(slope, 0, 0);
    for (const Vector2d &ahead : {Vector2d(9, 0), Vector2d(13, 1)})
      EXPECT_NEAR(plane.heightAt(ahead), slope.dot(ahead), 0.15) << slope.transpose();
  }
}

TEST(Ground, HeightsThatCountFromAboveItAreSeenThrough) { EXPECT_NEAR(planeAfterFlight({0, 0}, -1.3, 0).z, -1.3, 0.1); }

TEST(Ground, BushesOnHalfOfItAreNoHills)
{
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const GroundPlane plane = planeAfterFlight({0.15, 0}, 0, 0.5, seed);
    EXPECT_NEAR(plane.heightAt({11, 0}), 0.15 * 11, 0.3) << seed;
    EXPECT_NEAR(plane.z, 0.15 * plane.at.x(), 0.1) << seed;
  }
}

TEST(Ground, WithoutPointsItStaysAndFarAwayItGoesOnLevel)
{
  GroundFilter filter;
  EXPECT_EQ(filter.add({}, Vector3d(3, 0, 1)).heightAt({7, 0}), 0);
  const GroundPlane plane{{0, 0}, 1, {0.2, 0}};
  EXPECT_DOUBLE_EQ(plane.heightAt({5, 0}), 2);
  EXPECT_DOUBLE_EQ(plane.heightAt({100, 0}), plane.heightAt({50, 0}));
}
} // namespace
