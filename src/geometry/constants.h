// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Constants and units that more than one stage needs.

#include <cmath>
#include <cstdint>

namespace bole
{
constexpr double kDegree = 3.14159265358979323846 / 180; ///< one degree [rad]
constexpr double kGravity = 9.81;                        ///< of the Earth, to half a per cent everywhere [m/s^2]

/// [s] of a time in [ns]
inline double secondsOf(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }
/// [ns] of a time in [s]
inline std::int64_t nsOf(double s) { return std::llround(1e9 * s); }
} // namespace bole
