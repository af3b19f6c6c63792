// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What radii to expect.

#include <cmath>

namespace bole
{
/// A positive quantity with a normal logarithm.
struct LogNormal
{
  double log_mean = 0; ///< of the quantity in its unit
  double variance = 1; ///< of the logarithm

  /// Logarithm of the density of \p log at the logarithm of a quantity, less that at the median: 0 or less.
  double logOdds(double log) const { return -0.5 * (log - log_mean) * (log - log_mean) / variance; }
};
} // namespace bole
