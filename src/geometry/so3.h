// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Rotations: the exponential map of SO(3) and its derivatives.
///
/// A rotation aRb takes coordinates in frame b to frame a; adjacent letters cancel (aRc = aRb * bRc).
/// Perturbations stand on the right: R * Exp(phi), phi in radians, in the frame named last.
///
/// Laws (each a test): Exp(Log(R)) == R; Log(Exp(phi)) == phi for |phi| < pi;
/// Log(Exp(phi) * Exp(d)) - phi == Jr(phi)^-1 d to first order.

#include <bole/pose.h>

#include <cmath>

namespace bole
{
/// Skew-symmetric matrix with skew(a) * b == a x b.
Eigen::Matrix3d skew(const Eigen::Vector3d &a);

/// Rotation matrix of the rotation vector \p phi [rad].
Eigen::Matrix3d expSo3(const Eigen::Vector3d &phi);

/// Rotation vector [rad] of \p R, |result| <= pi. \p R must be a rotation to 1e-6.
Eigen::Vector3d logSo3(const Eigen::Matrix3d &R);

/// Inverse of the right Jacobian, |phi| < 2 pi: Exp(phi + Jr^-1(phi) d) == Exp(phi) * Exp(d) to first order.
Eigen::Matrix3d inverseRightJacobianSo3(const Eigen::Vector3d &phi);

/// A rotation beside \p R, at most twice as far as the nearest; removes the drift of long products.
Eigen::Matrix3d orthonormalized(const Eigen::Matrix3d &R);

/// Whether a matrix that somebody hands over is a rotation, but for the few digits with which matrices are written;
/// never where a number is not finite.
bool isRotation(const Eigen::Matrix3d &R);

/// Angle about the vertical from the world's x axis to the x axis of a body with its z axis up [rad], -pi to pi.
inline double yawOf(const Eigen::Matrix3d &wRb) { return std::atan2(wRb(1, 0), wRb(0, 0)); }
inline double yawOf(const Pose &wMb) { return yawOf(wMb.R); }
} // namespace bole
