// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The heading of a body with its z axis up.

#include <bole/pose.h>

#include <cmath>

namespace bole
{
/// Angle about the vertical from the world's x axis to the x axis of the body [rad], -pi to pi.
inline double yawOf(const Eigen::Matrix3d &wRb) { return std::atan2(wRb(1, 0), wRb(0, 0)); }
inline double yawOf(const Pose &wMb) { return yawOf(wMb.R); }
} // namespace bole
