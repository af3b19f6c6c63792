// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Constants, units, turns, quantiles and processor time.
#include <bole/pose.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <limits>
#include <vector>

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

/// The one of \p values below which the part \p share of them stays, 0 to 1: the nearest rank; NaN of none.
inline double quantileOf(std::vector<double> values, double share)
{
  if (values.empty())
    return std::numeric_limits<double>::quiet_NaN();
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The upper one of the two in the middle where the count is even; NaN of none.
inline double medianOf(const std::vector<double> &values) { return quantileOf(values, 0.5); }

/// What this process has computed, on all its threads, or by CLOCK_THREAD_CPUTIME_ID what this thread has: what other
/// programs take does not count.
inline double processorTime_ms(clockid_t clock = CLOCK_PROCESS_CPUTIME_ID)
{
  std::timespec now{};
  clock_gettime(clock, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}
} // namespace lab
} // namespace bole
