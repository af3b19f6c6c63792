// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Angles of options are given in degrees and used in radians.

namespace bole
{
constexpr double kDegree = 3.14159265358979323846 / 180; ///< one degree [rad]
} // namespace bole
