// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"

#include <Eigen/Geometry>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d skew(const Vector3d &a)
{
  Matrix3d S;
  S << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return S;
}

Matrix3d expSo3(const Vector3d &phi)
{
  const double angle2 = phi.squaredNorm();
  const Matrix3d S = skew(phi);
  if (angle2 < 1e-12)
    return Matrix3d::Identity() + S + 0.5 * S * S;
  const double angle = std::sqrt(angle2);
  Matrix3d squared = phi * phi.transpose(); // S S
  squared.diagonal().array() -= angle2;
  return Matrix3d::Identity() + std::sin(angle) / angle * S + (1 - std::cos(angle)) / angle2 * squared;
}

Vector3d logSo3(const Matrix3d &R)
{
  Eigen::Quaterniond q(R);
  if (q.w() < 0)
    q.coeffs() = -q.coeffs();
  const double sine = q.vec().norm();
  if (sine < 1e-9)
    return 2.0 / q.w() * q.vec();
  return 2.0 * std::atan2(sine, q.w()) / sine * q.vec();
}

Matrix3d inverseRightJacobianSo3(const Vector3d &phi)
{
  const double angle2 = phi.squaredNorm();
  const Matrix3d S = skew(phi);
  if (angle2 < 1e-8)
    return Matrix3d::Identity() + 0.5 * S + S * S / 12.0;
  const double half = 0.5 * std::sqrt(angle2);
  return Matrix3d::Identity() + 0.5 * S + (1 - half / std::tan(half)) / angle2 * S * S;
}

Matrix3d orthonormalized(const Matrix3d &R) { return Eigen::Quaterniond(R).normalized().toRotationMatrix(); }

bool isRotation(const Matrix3d &R)
{
  constexpr double kLoosest = 1e-3;
  return (R * R.transpose() - Matrix3d::Identity()).norm() < kLoosest && R.determinant() > 0;
}
} // namespace bole
