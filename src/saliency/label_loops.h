// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: labels of the pixels of one row from log odds at a coarser level.

#include <vector>

namespace bole
{
/// Between which columns of the coarser image each pixel lies, and how far from the left one.
struct ColumnsBetween
{
  std::vector<int> left;
  std::vector<float> share;
};

/// \p upper and \p lower: the rows of log odds above and below, \p share: how far from the upper one. Returns how many
/// pixels changed less than \p unknown_below from \p prior_log_odds.
int labelsOfRow(const float *upper, const float *lower, float share, const ColumnsBetween &columns,
                float prior_log_odds, float unknown_below, float *p_background, float *confidence);
} // namespace bole
