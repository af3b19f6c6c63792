// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Median and quantiles of a handful of measurements.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace bole
{
inline namespace lab
{
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
} // namespace lab
} // namespace bole
