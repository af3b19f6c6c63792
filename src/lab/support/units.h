// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Constants and units.

#include <bole/pose.h>

#include <cmath>
#include <cstdint>

namespace bole
{
inline namespace lab
{
constexpr double kDegree = 3.14159265358979323846 / 180; ///< one degree [rad]
constexpr double kGravity = 9.81;                        ///< of the Earth, to half a per cent everywhere [m/s^2]

/// [s] of a time in [ns]
inline double secondsOf(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }

/// Rotation matrix of the rotation vector \p phi [rad], and back.
inline Eigen::Matrix3d expSo3(const Eigen::Vector3d &phi)
{
  return Pose().plus((Vector6d() << 0, 0, 0, phi).finished()).R;
}
inline Eigen::Vector3d logSo3(const Eigen::Matrix3d &R)
{
  return Pose(R, Eigen::Vector3d::Zero()).minus(Pose()).tail<3>();
}

/// Angle about the vertical from the world's x axis to the x axis of the body [rad], -pi to pi.
inline double yawOf(const Eigen::Matrix3d &wRb) { return std::atan2(wRb(1, 0), wRb(0, 0)); }
inline double yawOf(const Pose &wMb) { return yawOf(wMb.R); }
} // namespace lab
} // namespace bole
