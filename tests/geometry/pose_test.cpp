// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/differences.h"

#include "geometry/direction.h"
#include "geometry/so3.h"
#include <bole/pose.h>
#include <visp3/core/vpExponentialMap.h>
#include <visp3/core/vpPoint.h>
#include <visp3/core/vpRotationMatrix.h>
#include <visp3/core/vpVelocityTwistMatrix.h>

namespace
{
using namespace bole;
using Eigen::Matrix3d;
using Eigen::Vector3d;

const Pose kA(expSo3({0.3, -0.7, 1.2}), {1, -2, 0.5});
const Pose kB(expSo3({-0.2, 0.1, 0.4}), {0.3, 0.2, -1});

Vector6d tangent()
{
  Vector6d xi;
  xi << 0.4, -0.3, 0.2, 0.5, -0.9, 0.3;
  return xi;
}

TEST(Pose, PlusAndMinusAreInverse)
{
  EXPECT_LT(kA.plus(Vector6d::Zero()).minus(kA).norm(), 1e-15);
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

/// Rotation vectors from nothing to nearly half a turn.
std::vector<Vector3d> rotationVectors()
{
  return {{0, 0, 0},
          {1e-9, -2e-9, 1e-9},
          {1e-4, 2e-4, -1e-4},
          {0.1, -0.2, 0.4},
          {1.5, -1.0, 0.7},
          {0, 0, 3.1},
          Vector3d(1, 2, -1).normalized() * 3.1415};
}

TEST(So3, ExpIsThatOfVisp)
{
  for (const Vector3d &phi : rotationVectors()) {
    const vpRotationMatrix visp(phi.x(), phi.y(), phi.z());
    for (unsigned i = 0; i < 3; ++i)
      for (unsigned j = 0; j < 3; ++j)
        EXPECT_NEAR(expSo3(phi)(i, j), visp[i][j], 1e-8) << phi.transpose();
  }
}

TEST(So3, LogUndoesExp)
{
  for (const Vector3d &phi : rotationVectors())
    EXPECT_LT((logSo3(expSo3(phi)) - phi).norm(), 1e-6 * phi.norm() + 1e-12) << phi.transpose();
}

TEST(So3, ExpUndoesLogAtHalfATurn)
{
  for (const Vector3d &axis : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1), Vector3d(1, -2, 3)}) {
    const Matrix3d R = Eigen::AngleAxisd(M_PI, axis.normalized()).toRotationMatrix();
    EXPECT_TRUE(expSo3(logSo3(R)).isApprox(R, 1e-6)) << axis.transpose();
  }
}

TEST(So3, InverseRightJacobianAgreesWithCentralDifferences)
{
  for (const Vector3d &phi : rotationVectors()) {
    const auto turned = [&](const Vector3d &xi) { return logSo3(expSo3(phi).transpose() * expSo3(phi + xi)); };
    EXPECT_TRUE((test::differences(turned, 3, 1e-4) * inverseRightJacobianSo3(phi)).isIdentity(1e-6))
        << phi.transpose();
  }
}

TEST(So3, OrthonormalizedIsARotationBesideItsArgument)
{
  for (const Vector3d &phi : rotationVectors()) {
    const Matrix3d R = expSo3(phi);
    EXPECT_TRUE(orthonormalized(R).isApprox(R, 1e-12));
    for (int i = 0; i < 9; ++i) {
      Matrix3d bent = R;
      bent(i / 3, i % 3) += 2e-3;
      const Matrix3d beside = orthonormalized(bent);
      EXPECT_TRUE((beside.transpose() * beside).isIdentity(1e-12));
      const Eigen::JacobiSVD<Matrix3d> svd(bent, Eigen::ComputeFullU | Eigen::ComputeFullV);
      const Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
      EXPECT_LT((beside - bent).norm(), 2 * (nearest - bent).norm()) << i << ": " << phi.transpose();
    }
  }
}

std::vector<Eigen::Vector3d> directions()
{
  std::vector<Eigen::Vector3d> all{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}, {1, 1, 1}, {-3, 0.2, 1}};
  for (auto &d : all)
    d.normalize();
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

TEST(Direction, PlusUndoesMinus)
{
  for (const auto &d : directions()) {
    for (const auto &e : directions()) {
      if (d.dot(e) > -0.999) {
        EXPECT_LT((directionPlus(d, directionMinus(e, d)) - e).norm(), 1e-9);
      }
    }
  }
  EXPECT_NEAR(directionMinus({std::sin(0.3), 0, std::cos(0.3)}, {0, 0, 1}).norm(), 0.3, 1e-12) << "it is the angle";
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

} // namespace
