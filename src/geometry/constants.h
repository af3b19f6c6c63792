// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Physical and mathematical constants that more than one stage needs.

namespace bole
{
constexpr double kDegree = 3.14159265358979323846 / 180; ///< one degree [rad]
constexpr double kGravity = 9.81;                        ///< of the Earth, to half a per cent everywhere [m/s^2]
} // namespace bole
