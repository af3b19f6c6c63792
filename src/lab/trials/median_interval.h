// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far a median over a few runs can be trusted.

#include <cstdint>
#include <limits>
#include <vector>

namespace bole
{
struct MedianInterval
{
  double median = std::numeric_limits<double>::quiet_NaN(); ///< NaN without values
  double low = median, high = median;                       ///< 95 % interval; NaN with fewer than two values
  std::size_t count = 0;
};

/// Median of \p values (mean of the middle two of an even number) and its percentile bootstrap interval: the 2.5 and
/// 97.5 % quantiles of the medians of \p resamples drawings with replacement. NaN among the values is left out.
///
/// Laws (each a test): low <= median <= high; equal values give an interval of no width; of samples of a normal the
/// interval holds the true median in about 95 of 100; the same seed, the same interval.
MedianInterval bootstrapMedian(std::vector<double> values, int resamples = 2000, std::uint64_t seed = 1);

/// 95 % interval of a share of successes (Wilson); NaN without runs.
struct ShareInterval
{
  double share = std::numeric_limits<double>::quiet_NaN(), low = share, high = share;
};
ShareInterval wilson(int successes, int runs);
} // namespace bole
