// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>

namespace bole
{
/// Where the parabola through three samples has its peak, from the middle one: -0.5 to 0.5 of their spacing; 0 where it
/// has none.
inline double peakOffset(double before, double middle, double after)
{
  const double bend = before - 2 * middle + after;
  return bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
}
} // namespace bole
