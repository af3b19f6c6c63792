// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <gtest/gtest.h>

#include <bole/visp.h>
#include <vector>
#include <visp3/core/vpExponentialMap.h>
#include <visp3/core/vpRotationMatrix.h>

namespace
{
using namespace bole;
using Eigen::Matrix3d;
using Eigen::Vector3d;

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

TEST(So3, ExpIsARotation)
{
  for (const Vector3d &phi : rotationVectors()) {
    const Matrix3d R = expSo3(phi);
    EXPECT_TRUE((R.transpose() * R).isIdentity(1e-12));
    EXPECT_NEAR(R.determinant(), 1, 1e-12);
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

TEST(So3, SkewIsTheCrossProduct)
{
  const Vector3d a(1, -2, 3), b(0.5, 4, -1);
  EXPECT_LT((skew(a) * b - a.cross(b)).norm(), 1e-15);
}

Matrix3d differencesOfExp(const Vector3d &phi, double h)
{
  Matrix3d J;
  for (int i = 0; i < 3; ++i) {
    const Vector3d step = h * Vector3d::Unit(i);
    J.col(i) =
        (logSo3(expSo3(phi).transpose() * expSo3(phi + step)) - logSo3(expSo3(phi).transpose() * expSo3(phi - step))) /
        (2 * h);
  }
  return J;
}

TEST(So3, InverseRightJacobianAgreesWithCentralDifferences)
{
  for (const Vector3d &phi : rotationVectors())
    EXPECT_TRUE((differencesOfExp(phi, 1e-4) * inverseRightJacobianSo3(phi)).isIdentity(1e-6)) << phi.transpose();
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
} // namespace
