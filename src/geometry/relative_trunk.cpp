// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include <bole/trunk.h>

#include <Eigen/Geometry>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

Trunk Trunk::plus(const Vector5d &xi) const
{
  Trunk moved = *this;
  moved.xy += xi.head<2>();
  moved.log_radius += xi(2);
  moved.lean += xi.tail<2>();
  return moved;
}

Vector5d Trunk::minus(const Trunk &other) const
{
  Vector5d xi;
  xi << xy - other.xy, log_radius - other.log_radius, lean - other.lean;
  return xi;
}

RelativeTrunk RelativeTrunk::plus(const Vector4d &xi) const
{
  return {orthonormalized(cRt * expSo3(xi.head<3>())), log_ratio + xi(3)};
}

Vector4d RelativeTrunk::minus(const RelativeTrunk &x) const
{
  Vector4d xi;
  xi << logSo3(x.cRt.transpose() * cRt), log_ratio - x.log_ratio;
  return xi;
}

Vector3d RelativeTrunk::borderDirection(Border border, double tan_elevation) const
{
  const double sine = (border == Border::left ? 1 : -1) * std::min(ratio(), 1.0);
  return cRt * Vector3d(std::sqrt(1 - sine * sine), sine, tan_elevation);
}

Vector3d RelativeTrunk::borderNormal(Border border) const
{
  const double s = std::min(ratio(), 1.0);
  const double side = border == Border::left ? 1 : -1;
  return cRt * Vector3d(-s, side * std::sqrt(1 - s * s), 0);
}

RelativeTrunk betweenBorders(const Matrix3d &cRl, double q_left, double q_right)
{
  const double left = std::atan(q_left), right = std::atan(q_right);
  RelativeTrunk relative;
  relative.cRt = cRl * Eigen::AngleAxisd(0.5 * (left + right), Vector3d::UnitZ()).toRotationMatrix();
  relative.log_ratio = std::log(std::sin(0.5 * (left - right)));
  return relative;
}

RelativeTrunk relativeTrunk(const Pose &wMb, const Pose &bMc, const Trunk &trunk, Matrix46d *J_pose, Matrix45d *J_trunk)
{
  const Vector3d wpc = wMb * bMc.t;
  const Vector3d n(trunk.lean.x(), trunk.lean.y(), 1);
  const double n_norm = n.norm();
  const Vector3d a = n / n_norm; // axis

  // Eq. 6, the vector from the camera centre to the nearest point of the axis
  const Vector3d v = Vector3d(trunk.xy.x(), trunk.xy.y(), 0) - wpc;
  const double along = a.dot(v);
  const Vector3d v_perp = v - along * a;
  const double d = v_perp.norm();

  // Eq. 8
  Matrix3d wRt;
  wRt.col(0) = v_perp / d;
  wRt.col(2) = a;
  wRt.col(1) = a.cross(wRt.col(0));

  RelativeTrunk relative;
  relative.cRt = bMc.R.transpose() * (wMb.R.transpose() * wRt); // Eq. 7
  relative.log_ratio = trunk.log_radius - std::log(d);

  if (!J_pose && !J_trunk)
    return relative;

  // A move dv of the vector to the axis turns the bearing by y.dv/d and changes log d by x.dv/d; a turn
  // da of the axis adds the turns phi_x, phi_y and moves the nearest point by -along * da.
  const Vector3d x = wRt.col(0), y = wRt.col(1);
  if (J_pose) {
    Eigen::Matrix<double, 3, 6> dv;
    dv.leftCols<3>() = -wMb.R;
    dv.rightCols<3>() = wMb.R * skew(bMc.t);
    J_pose->setZero();
    J_pose->row(2) = y.transpose() * dv / d;
    J_pose->row(3) = -x.transpose() * dv / d;
    J_pose->block<3, 3>(0, 3) -= wRt.transpose() * wMb.R;
  }
  if (J_trunk) {
    J_trunk->setZero();
    (*J_trunk)(2, 0) = y.x() / d;
    (*J_trunk)(2, 1) = y.y() / d;
    (*J_trunk)(3, 0) = -x.x() / d;
    (*J_trunk)(3, 1) = -x.y() / d;
    (*J_trunk)(3, 2) = 1;
    for (int i = 0; i < 2; ++i) {
      const Vector3d da = (Vector3d::Unit(i) - a * a(i)) / n_norm;
      (*J_trunk)(0, 3 + i) = -y.dot(da);
      (*J_trunk)(1, 3 + i) = x.dot(da);
      (*J_trunk)(2, 3 + i) = -along * y.dot(da) / d;
      (*J_trunk)(3, 3 + i) = along * x.dot(da) / d;
    }
  }
  return relative;
}

Trunk trunkFromRelative(const Pose &wMc, const RelativeTrunk &relative, double radius)
{
  const Vector3d away = wMc.R * relative.cRt.col(0);
  Trunk trunk;
  trunk.log_radius = std::log(radius);
  trunk.xy = wMc.t.head<2>() + radius / relative.ratio() * away.head<2>().normalized();
  return trunk;
}
} // namespace bole
