// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Gravity as an accelerometer has it against that of an odometry.
///
/// Idea: the mean force between two moments, turned by the odometry, is gravity and the change of the odometry's own
/// velocity from one to the other. What is left is a bias of the accelerometer or a wrong attitude of the odometry, and
/// by itself it does not tell which: only that an attitude leaves the length of the force as it is.

#include <bole/frame.h>

#include <optional>
#include <vector>

namespace bole
{
struct GravityInnovation
{
  Eigen::Vector3d off = Eigen::Vector3d::Zero(); ///< what is left, in the odometry's world [m/s^2]
  double sigma = 0;                              ///< of each component, by the odometry's velocities [m/s^2]
  /// Derivatives of `off`: by a rotation of the odometry's body (bRo, left tangent), and by what is taken off the
  /// force.
  Eigen::Matrix3d by_rotation = Eigen::Matrix3d::Zero(), by_bias = Eigen::Matrix3d::Zero();
};

/// Of \p poses, the first and the last more than 1.2 s apart, and \p samples, both in the order of time. Nothing where
/// poses or samples are missing in between, or samples have no force or repeat one.
std::optional<GravityInnovation> compareGravity(const Trajectory &poses, const std::vector<GyroSample> &samples);
} // namespace bole
