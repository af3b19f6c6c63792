// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/direction.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <vector>

namespace
{
using bole::directionBasis;
using bole::directionMinus;
using bole::directionPlus;

std::vector<Eigen::Vector3d> directions()
{
  std::vector<Eigen::Vector3d> all{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}, {1, 1, 1}, {-3, 0.2, 1}};
  for (auto &d : all) {
    d.normalize();
  }
  return all;
}

TEST(Direction, BasisIsRightHandedAndPerpendicular)
{
  for (const auto &d : directions()) {
    const bole::Matrix32d B = directionBasis(d);
    EXPECT_TRUE((B.transpose() * B).isIdentity(1e-12));
    EXPECT_LT((B.transpose() * d).norm(), 1e-12);
    EXPECT_LT((B.col(0).cross(B.col(1)) - d).norm(), 1e-12);
  }
}

TEST(Direction, PlusZeroChangesNothing)
{
  for (const auto &d : directions()) {
    EXPECT_LT((directionPlus(d, Eigen::Vector2d::Zero()) - d).norm(), 1e-15);
  }
}

TEST(Direction, PlusUndoesMinus)
{
  for (const auto &d : directions()) {
    for (const auto &e : directions()) {
      if (d.dot(e) > -0.999) {
        EXPECT_LT((directionPlus(d, directionMinus(e, d)) - e).norm(), 1e-9);
      }
    }
  }
}

TEST(Direction, IsTurnedToAnotherByTheLeastRotation)
{
  for (const auto &d : directions()) {
    std::vector<Eigen::Vector3d> others = directions();
    others.push_back(-d);
    for (const auto &e : others) {
      const Eigen::Matrix3d R = bole::rotationBetween(2 * d, e);
      EXPECT_LT((R * d - e).norm(), 1e-12);
      EXPECT_TRUE((R.transpose() * R).isIdentity(1e-12));
      EXPECT_NEAR(R.trace(), 1 + 2 * d.dot(e), 1e-12);
    }
  }
}

TEST(Direction, MinusIsTheAngle)
{
  const Eigen::Vector3d d(0, 0, 1), e(std::sin(0.3), 0, std::cos(0.3));
  EXPECT_NEAR(directionMinus(e, d).norm(), 0.3, 1e-12);
}
} // namespace
