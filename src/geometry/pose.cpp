// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include <bole/pose.h>

#include <Eigen/Geometry>

namespace bole
{
Pose::Pose(const Eigen::Matrix3d &rotation, const Eigen::Vector3d &translation) : R(rotation), t(translation) {}

Pose Pose::fromQuaternion(double qw, double qx, double qy, double qz, const Eigen::Vector3d &t)
{
  return {Eigen::Quaterniond(qw, qx, qy, qz).normalized().toRotationMatrix(), t};
}

Pose Pose::fromVisp(const vpHomogeneousMatrix &aMb)
{
  Pose pose;
  for (unsigned int i = 0; i < 3; ++i) {
    for (unsigned int j = 0; j < 3; ++j)
      pose.R(i, j) = aMb[i][j];
    pose.t(i) = aMb[i][3];
  }
  return pose;
}

vpHomogeneousMatrix Pose::toVisp() const
{
  vpHomogeneousMatrix aMb;
  for (unsigned int i = 0; i < 3; ++i) {
    for (unsigned int j = 0; j < 3; ++j)
      aMb[i][j] = R(i, j);
    aMb[i][3] = t(i);
  }
  return aMb;
}

Pose Pose::plus(const Vector6d &xi) const { return {orthonormalized(R * expSo3(xi.tail<3>())), t + R * xi.head<3>()}; }

Vector6d Pose::minus(const Pose &x) const
{
  Vector6d xi;
  xi.head<3>() = x.R.transpose() * (t - x.t);
  xi.tail<3>() = logSo3(x.R.transpose() * R);
  return xi;
}

Matrix6d adjoint(const Pose &aMb)
{
  Matrix6d Ad = Matrix6d::Zero();
  Ad.topLeftCorner<3, 3>() = aMb.R;
  Ad.topRightCorner<3, 3>() = skew(aMb.t) * aMb.R;
  Ad.bottomRightCorner<3, 3>() = aMb.R;
  return Ad;
}
} // namespace bole
