// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/direction.h"

#include <Eigen/Geometry>

#include <cmath>

namespace bole
{
Matrix32d directionBasis(const Eigen::Vector3d &d)
{
  Eigen::Index least = 0;
  d.cwiseAbs().minCoeff(&least);
  Matrix32d B;
  B.col(0) = Eigen::Vector3d::Unit(least).cross(d).normalized();
  B.col(1) = d.cross(B.col(0));
  return B;
}

Eigen::Vector3d directionPlus(const Eigen::Vector3d &d, const Eigen::Vector2d &tau)
{
  const double angle = tau.norm();
  const double sinc = angle < 1e-8 ? 1.0 : std::sin(angle) / angle;
  return (std::cos(angle) * d + sinc * (directionBasis(d) * tau)).normalized();
}

Eigen::Vector2d directionMinus(const Eigen::Vector3d &e, const Eigen::Vector3d &d)
{
  Eigen::Vector2d in_plane = directionBasis(d).transpose() * e;
  const double sine = in_plane.norm();
  if (sine < 1e-12)
    return in_plane;
  return in_plane * (std::atan2(sine, d.dot(e)) / sine);
}

Eigen::Matrix3d rotationBetween(const Eigen::Vector3d &from, const Eigen::Vector3d &to)
{
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cosine = b.dot(a);
  Eigen::Quaterniond rotation;
  if (cosine < -1 + 1e-12) { // by half a turn about any axis across
    rotation.w() = 0;
    rotation.vec() = directionBasis(a).col(0);
  }
  else {
    const double s = std::sqrt(2 * (1 + cosine));
    rotation.vec() = a.cross(b) * (1 / s);
    rotation.w() = 0.5 * s;
  }
  return rotation.toRotationMatrix();
}
} // namespace bole
