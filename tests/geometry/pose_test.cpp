// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include <bole/pose.h>

#include <gtest/gtest.h>

#include <visp3/core/vpPoint.h>
#include <visp3/core/vpVelocityTwistMatrix.h>

namespace
{
using namespace bole;
using Eigen::Vector3d;

const Pose kA(expSo3({0.3, -0.7, 1.2}), {1, -2, 0.5});
const Pose kB(expSo3({-0.2, 0.1, 0.4}), {0.3, 0.2, -1});

Vector6d tangent()
{
  Vector6d xi;
  xi << 0.4, -0.3, 0.2, 0.5, -0.9, 0.3;
  return xi;
}

TEST(Pose, PlusZeroChangesNothing) { EXPECT_LT(kA.plus(Vector6d::Zero()).minus(kA).norm(), 1e-15); }

TEST(Pose, PlusAndMinusAreInverse)
{
  EXPECT_LT((kA.plus(tangent()).minus(kA) - tangent()).norm(), 1e-12);
  EXPECT_LT(kA.plus(kB.minus(kA)).minus(kB).norm(), 1e-12);
}

TEST(Pose, TimesItsInverseIsTheIdentity)
{
  EXPECT_LT((kA * kA.inverse()).minus(Pose()).norm(), 1e-12);
  EXPECT_LT((kA.inverse() * kA).minus(Pose()).norm(), 1e-12);
}

TEST(Pose, ComposesAndMovesPointsAsVispDoes)
{
  const vpHomogeneousMatrix visp = kA.toVisp() * kB.toVisp();
  EXPECT_LT(Pose::fromVisp(visp).minus(kA * kB).norm(), 1e-9);
  vpPoint point(0.3, -1.2, 2.0);
  point.changeFrame(kA.toVisp());
  const Vector3d moved = kA * Vector3d(0.3, -1.2, 2.0);
  EXPECT_NEAR(point.get_X(), moved.x(), 1e-12);
  EXPECT_NEAR(point.get_Y(), moved.y(), 1e-12);
  EXPECT_NEAR(point.get_Z(), moved.z(), 1e-12);
}

TEST(Pose, ComesBackFromVisp) { EXPECT_LT(Pose::fromVisp(kA.toVisp()).minus(kA).norm(), 1e-9); }

TEST(Pose, AQuaternionNeedNotBeNormalised)
{
  // half the angle in w: 60 degrees about z
  const Pose pose = Pose::fromQuaternion(2 * std::cos(M_PI / 6), 0, 0, 2 * std::sin(M_PI / 6), {1, 2, 3});
  EXPECT_LT((logSo3(pose.R) - Vector3d(0, 0, M_PI / 3)).norm(), 1e-12);
}

/// ViSP's twist matrix takes velocities of frame b to frame a in the same order (v, omega).
TEST(Pose, AdjointIsVispsTwistMatrix)
{
  const vpVelocityTwistMatrix visp(kA.toVisp());
  const Matrix6d ours = adjoint(kA);
  for (unsigned i = 0; i < 6; ++i)
    for (unsigned j = 0; j < 6; ++j)
      EXPECT_NEAR(ours(i, j), visp[i][j], 1e-9) << i << " " << j;
}

TEST(Pose, AdjointCarriesASmallMotionFromOneFrameToTheOther)
{
  const auto errorAt = [](double h) {
    const Vector6d xi = h * tangent();
    return (kA * Pose().plus(xi)).minus(Pose().plus(adjoint(kA) * xi) * kA).norm();
  };
  EXPECT_LT(errorAt(1e-4), 1e-6);
  EXPECT_NEAR(errorAt(2e-4) / errorAt(1e-4), 4, 0.1); // what is left is of second order
}

TEST(Pose, NaNIsNotFinite)
{
  Pose pose = kA;
  EXPECT_TRUE(pose.isFinite());
  pose.t.y() = std::nan("");
  EXPECT_FALSE(pose.isFinite());
}
} // namespace
