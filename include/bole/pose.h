// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Rigid-body poses aMb, as ViSP's vpHomogeneousMatrix, on Eigen.

#include <Eigen/Core>

#include <bole/visp.h>
#include <cstdint>
#include <vector>
#include <visp3/core/vpHomogeneousMatrix.h>

namespace bole
{
using Vector6d = Eigen::Matrix<double, 6, 1>; ///< a step of a pose: translation [m], then rotation [rad]
using Matrix6d = Eigen::Matrix<double, 6, 6>; ///< covariance of such a step

/// Pose aMb of frame b in frame a: a point bp has the coordinates ap = R bp + t in frame a.
///
/// Tangent: (rho, phi) in [m, rad], both in frame b: plus(xi) = (t + R rho, R Exp(phi)).
///
/// Laws (each a test): x.plus(0) == x; x.plus(y.minus(x)) == y; x.plus(xi).minus(x) == xi for |phi| < pi;
/// x * x.inverse() == identity; fromVisp(toVisp(x)) == x.
struct Pose
{
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity(); ///< rotation
  Eigen::Vector3d t = Eigen::Vector3d::Zero();     ///< [m]

  Pose() = default;
  /// From its parts.
  Pose(const Eigen::Matrix3d &rotation, const Eigen::Vector3d &translation);
  /// From a unit quaternion in the order w, x, y, z (normalised here).
  static Pose fromQuaternion(double qw, double qx, double qy, double qz, const Eigen::Vector3d &t);
  /// From ViSP's matrix.
  static Pose fromVisp(const vpHomogeneousMatrix &aMb);
  /// As ViSP's matrix.
  vpHomogeneousMatrix toVisp() const;

  /// Chains aMb and bMc to aMc.
  Pose operator*(const Pose &bMc) const { return {R * bMc.R, R * bMc.t + t}; }
  /// Takes the coordinates of a point from b to a.
  Eigen::Vector3d operator*(const Eigen::Vector3d &bp) const { return R * bp + t; }
  /// bMa.
  Pose inverse() const { return {R.transpose(), -(R.transpose() * t)}; }

  /// The pose moved by \p xi in its own frame: translation [m], then rotation vector [rad].
  Pose plus(const Vector6d &xi) const;
  /// Tangent xi at \p x with x.plus(xi) == *this.
  Vector6d minus(const Pose &x) const;

  /// No number is NaN or infinite.
  bool isFinite() const { return R.allFinite() && t.allFinite(); }
};

/// Adjoint of \p aMb in the order (rho, phi): aMb * x.plus(xi) == (aMb * x * ...) with
/// Exp(Ad(aMb) xi) * aMb == aMb * Exp(xi) to first order. Carries a covariance of b's tangent to a's.
Matrix6d adjoint(const Pose &aMb);

/// A pose and its time.
struct StampedPose
{
  std::int64_t stamp_ns = 0; ///< of the frame
  Pose wMb;                  ///< world from body
};

/// Poses of the body in the world with strictly rising stamps.
using Trajectory = std::vector<StampedPose>;
} // namespace bole
