// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/silhouette.h"
#include "geometry/so3.h"
#include <bole/cylinder.h>

#include <gtest/gtest.h>

#include <cmath>

namespace
{
using namespace bole;
using Eigen::Vector3d;

/// A trunk 4 m ahead along x of a camera frame whose z is up, turned by \p R.
RelativeTrunk ahead(const Eigen::Matrix3d &R = Eigen::Matrix3d::Identity())
{
  Cylinder c;
  c.foot = R * Vector3d(4, 0, -1), c.top = R * Vector3d(4, 0, 3), c.radius = 0.3;
  return relativeTrunk(c);
}

Vector3d bearing(double angle, double tan_elevation = 0) { return {std::cos(angle), std::sin(angle), tan_elevation}; }

TEST(Silhouette, HalfWidthIsTheAngleToATangent)
{
  EXPECT_NEAR(std::sin(silhouetteHalfWidth(0.3, 4)), 0.3 / 4, 1e-15);
  EXPECT_NEAR(silhouetteHalfWidth(0.3, 0.1), std::asin(0.99), 1e-15);
}

TEST(Silhouette, CoversTheBearingsWithinItsHalfWidthAndTheMargin)
{
  for (const Eigen::Matrix3d &R : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), expSo3({0.4, -0.7, 0.2})})
    for (const double margin : {-0.01, 0.0, 0.02}) {
      const double edge = silhouetteHalfWidth(0.3, 4) + margin;
      for (const double side : {-1.0, 1.0}) {
        EXPECT_TRUE(Silhouette(ahead(R), margin).covers(7 * R * bearing(side * (edge - 1e-9), 0.4)));
        EXPECT_FALSE(Silhouette(ahead(R), margin).covers(7 * R * bearing(side * (edge + 1e-9), 0.4)));
      }
    }
}

TEST(Silhouette, CoversNothingBehindTheCameraAboveItsTopOrBelowItsFoot)
{
  EXPECT_FALSE(Silhouette(ahead()).covers(bearing(M_PI)));
  const Silhouette stem(ahead(), 0, -0.25, 0.75);
  EXPECT_TRUE(stem.covers(bearing(0, 0.74)));
  EXPECT_FALSE(stem.covers(bearing(0, 0.76)));
  EXPECT_FALSE(stem.covers(bearing(0, -0.26)));
}

TEST(Cylinder, OfATrunkIsItsAxisBetweenTwoHeights)
{
  Trunk trunk;
  trunk.xy = {3, -1}, trunk.lean = {0.1, -0.02}, trunk.log_radius = std::log(0.2);
  const Cylinder c = cylinderOf(trunk, 0.5, 2.5, "7");
  EXPECT_LT((c.foot - Vector3d(3.05, -1.01, 0.5)).norm(), 1e-12);
  EXPECT_LT((c.top - Vector3d(3.25, -1.05, 2.5)).norm(), 1e-12);
  EXPECT_NEAR(c.radius, 0.2, 1e-15);
  EXPECT_EQ(c.name, "7");
}
} // namespace
