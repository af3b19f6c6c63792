// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/label_loops.h"

#include "geometry/vector_clones.h"
#include "saliency/fast_math.h"

#include <cmath>

namespace bole
{
BOLE_VECTOR_CLONES
int labelsOfRow(const float *upper, const float *lower, float share, const ColumnsBetween &columns,
                float prior_log_odds, float unknown_below, float *__restrict p_background, float *__restrict confidence)
{
  const int n = static_cast<int>(columns.left.size()), *left = columns.left.data();
  const float *between = columns.share.data();
  int unknown = 0;
#pragma omp simd reduction(+ : unknown)
  for (int j = 0; j < n; ++j) {
    const int c = left[j];
    const float above = upper[c] + between[j] * (upper[c + 1] - upper[c]);
    const float below = lower[c] + between[j] * (lower[c + 1] - lower[c]);
    const float odds = above + share * (below - above);
    const float change = std::abs(odds - prior_log_odds);
    p_background[j] = 1 / (1 + fastExp(odds));
    confidence[j] = change;
    unknown += change < unknown_below ? 1 : 0;
  }
  return unknown;
}
} // namespace bole
