// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Directions: unit vectors of R^3, their tangent plane and its basis.
///
/// A translation known but for its length is a direction. Everything that states a covariance of a
/// direction (relative pose, gravity) uses the basis of directionBasis().
///
/// Laws (each a test): directionPlus(d, 0) == d; directionPlus(d, directionMinus(e, d)) == e for e
/// != -d; B = directionBasis(d) has orthonormal columns, perpendicular to d, with b1 x b2 == d.

#include <Eigen/Core>

namespace bole
{
using Matrix32d = Eigen::Matrix<double, 3, 2>;

/// Orthonormal basis (b1, b2) of the plane perpendicular to the unit vector \p d: b1 = normalised(e
/// x d) with e the coordinate axis least aligned with d (the first of equals), b2 = d x b1.
Matrix32d directionBasis(const Eigen::Vector3d &d);

/// The direction at the angle |tau| [rad] from \p d along directionBasis(d) * tau (exponential map).
Eigen::Vector3d directionPlus(const Eigen::Vector3d &d, const Eigen::Vector2d &tau);

/// Tangent tau [rad] at \p d with directionPlus(d, tau) == \p e.
Eigen::Vector2d directionMinus(const Eigen::Vector3d &e, const Eigen::Vector3d &d);

/// The least rotation that takes the direction of \p from to that of \p to. (Eigen's FromTwoVectors() does it, too, and
/// makes each file that calls it compile a singular value decomposition.)
Eigen::Matrix3d rotationBetween(const Eigen::Vector3d &from, const Eigen::Vector3d &to);
} // namespace bole
