// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The factors of the smoother (Eq. 2): each turns the variables it touches into a whitened
/// residual r and its Jacobians, and costs rho(|r|^2) / 2. Tangents are those of Pose, (rho [m],
/// phi [rad]) on the right, and of Trunk, (x [m], y [m], log r, lean x, lean y).
///
/// Laws (each a test): every Jacobian agrees with central differences; a measurement equal to the
/// prediction has residual 0.

#include "geometry/direction.h"
#include "summary/square_root.h"
#include <bole/factors.h>

namespace bole
{
using Matrix56d = Eigen::Matrix<double, 5, 6>;

/// Square roots S of information matrices, S^T S = covariance^-1. Throws vpException(badValue)
/// naming \p name when \p covariance is not finite, symmetric and positive definite.
template <int N>
Eigen::Matrix<double, N, N> squareRootInformation(const Eigen::Matrix<double, N, N> &covariance, const char *name);
inline Matrix6d squareRootInformation(const PosePrior &prior)
{
  return squareRootInformation<6>(prior.covariance, "pose prior covariance");
}
inline Matrix6d squareRootInformation(const Odometry &odometry)
{
  return squareRootInformation<6>(odometry.covariance, "odometry covariance");
}
inline Matrix5d squareRootInformation(const RelativePoseMeasurement &measurement)
{
  return squareRootInformation<5>(measurement.covariance, "relative pose covariance");
}

/// Residuals. \p S is the square root information; Jacobians may be null.
Vector6d residual(const PosePrior &prior, const Matrix6d &S, const Pose &wMb, Matrix6d *J);
Vector6d residual(const Odometry &odometry, const Matrix6d &S, const Pose &wMa, const Pose &wMb, Matrix6d *J_a,
                  Matrix6d *J_b);
Vector5d residual(const RelativePoseMeasurement &measurement, const Matrix5d &S, const Pose &bMc, const Pose &wMa,
                  const Pose &wMb, Matrix56d *J_a, Matrix56d *J_b);
Vector5d residual(const TrunkPrior &prior, const Trunk &trunk);
/// Zero residual and Jacobians where the camera stands in the axis: such a view says nothing
/// usable.
Vector4d residual(const SquareRootSummary &summary, const Pose &bMc, const Pose &wMb, const Trunk &trunk,
                  Matrix46d *J_pose, Matrix45d *J_trunk);
} // namespace bole
