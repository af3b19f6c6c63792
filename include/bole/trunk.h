// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A trunk in the world, and what one camera can see of it.
///
/// Idea: a cylinder seen from a point has two silhouette planes through the camera centre. Both contain
/// the direction of the axis and stand at +-asin(r/d) from the bearing, so one view knows exactly four
/// numbers: the relative rotation of the trunk (3) and the ratio s = r/d (1). Everything an image can say
/// about a trunk is a function of these four (paper, Section 4.2, Eq. 5-8).
///
/// Deviations from the paper: Eq. 6 measures d from the robot, we measure it from the camera centre, since
/// the silhouette is that of the camera; the paper's trunk is vertical, ours may lean (lean == 0 gives the
/// paper's), and the view stays exact since d is then the distance to the leaning axis; true tangent
/// planes (asin) instead of small angles.

#include <bole/pose.h>

#include <cmath>

namespace bole
{
using Vector4d = Eigen::Matrix<double, 4, 1>;  ///< a step of a relative trunk: rotation [rad], log r/d
using Vector5d = Eigen::Matrix<double, 5, 1>;  ///< a step of a trunk: place [m, m], log radius, lean (2)
using Matrix4d = Eigen::Matrix<double, 4, 4>;  ///< covariance of a relative trunk
using Matrix5d = Eigen::Matrix<double, 5, 5>;  ///< covariance of a trunk
using Matrix46d = Eigen::Matrix<double, 4, 6>; ///< relative trunk by pose
using Matrix45d = Eigen::Matrix<double, 4, 5>; ///< relative trunk by trunk

/// A trunk in the world frame: the cylinder of radius exp(log_radius) [m] round the axis that passes
/// through (x, y, 0) with the direction (lean.x, lean.y, 1).
///
/// Tangent (x [m], y [m], log r, lean x, lean y): plus() adds.
struct Trunk
{
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();   ///< [m], where the axis meets the plane z = 0 of the world
  double log_radius = std::log(0.15);             ///< log of the radius in metres: the radius stays positive
  Eigen::Vector2d lean = Eigen::Vector2d::Zero(); ///< tan of the lean towards x and y of the world

  /// [m]
  double radius() const { return std::exp(log_radius); }
  /// Point of the axis at the height \p z [m] of the world.
  Eigen::Vector3d axisAt(double z) const { return {xy.x() + lean.x() * z, xy.y() + lean.y() * z, z}; }
  /// The trunk moved by \p xi.
  Trunk plus(const Vector5d &xi) const;
  /// The step that leads from \p other to this.
  Vector5d minus(const Trunk &other) const;
};

/// Side of a trunk in the image.
enum class Border
{
  left,
  right
}; ///< as seen from the camera, z of the trunk up

/// The relative trunk theta^r = (cRt, r/d) of SO(3) x R+.
///
/// Trunk frame t: x from the camera to the axis, perpendicular to the axis; z along the axis, up; y left.
/// Tangent (phi_x, phi_y, phi_z, d log s), rotation on the right: phi_z moves the bearing, phi_x turns
/// the trunk in the image, phi_y tips it away from the camera, d log s widens it.
///
/// Laws (each a test): x.plus(0) == x; x.plus(y.minus(x)) == y; the borders of relativeTrunk() are the
/// limbs of ViSP's vpCylinder projection; the Jacobians of relativeTrunk() agree with central differences.
struct RelativeTrunk
{
  Eigen::Matrix3d cRt = Eigen::Matrix3d::Identity(); ///< from the trunk frame to the camera
  double log_ratio = std::log(0.05);                 ///< log(r/d), below 0 outside the trunk

  /// Radius over distance, r/d.
  double ratio() const { return std::exp(log_ratio); }
  /// The relative trunk moved by \p xi.
  RelativeTrunk plus(const Vector4d &xi) const;
  /// The step that leads from \p x to this.
  Vector4d minus(const RelativeTrunk &x) const;

  /// Direction in the camera frame of the point of a border whose tangent of elevation above the
  /// horizontal plane of the trunk frame is \p tan_elevation. Its x-y part in t has norm 1.
  Eigen::Vector3d borderDirection(Border border, double tan_elevation) const;
  /// Unit normal in the camera frame of the silhouette plane; the trunk lies on its negative side.
  Eigen::Vector3d borderNormal(Border border) const;
  /// No number is NaN or infinite, and the camera stands outside the trunk.
  bool isFinite() const { return cRt.allFinite() && std::isfinite(log_ratio) && log_ratio < 0; }
};

/// The relative trunk of \p trunk seen by the camera at wMb * bMc (Eq. 5-8). log_ratio >= 0 (not
/// isFinite()) when the camera centre is inside the trunk. \p J_pose: 4x6 Jacobian by the tangent (rho, phi) of wMb, or
/// nullptr; \p J_trunk: 4x5 Jacobian by the tangent of the trunk, or nullptr.
RelativeTrunk relativeTrunk(const Pose &wMb, const Pose &bMc, const Trunk &trunk, Matrix46d *J_pose = nullptr,
                            Matrix45d *J_trunk = nullptr);

/// The upright relative trunk whose borders have the bearings \p q_left > \p q_right [tan, to the left] in the level
/// frame l (x ahead, z up) that \p cRl turns into the camera's.
///
/// Law (a test): its borderDirection()s have these bearings.
RelativeTrunk betweenBorders(const Eigen::Matrix3d &cRl, double q_left, double q_right);

/// The upright trunk of radius \p radius [m] that gives the relative trunk \p relative from the camera
/// pose \p wMc: the inverse of relativeTrunk() once the radius is known (lean is set to zero).
Trunk trunkFromRelative(const Pose &wMc, const RelativeTrunk &relative, double radius);
} // namespace bole
