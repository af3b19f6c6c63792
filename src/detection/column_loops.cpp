// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/column_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <cmath>

namespace bole
{
BOLE_VECTOR_CLONES
void differencesAtRanges(const LevelColumn &column, const CarriedColumn &carried, const OtherColumns &other,
                         float by_value, float by_slope, const float *ranges, int n, float *__restrict differences)
{
  constexpr float kLeastAhead = 0.1f; // [m]
  const CarriedColumn c = carried;
  const float q_first = other.q_first, by_step = other.by_step, last = static_cast<float>(other.count - 1);
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const float r = ranges[i], ahead_there = c.ahead0 + r * c.ahead1, left = c.left0 + r * c.left1;
    const bool is_ahead = ahead_there >= kLeastAhead;
    const float ahead = is_ahead ? ahead_there : kLeastAhead, q = left / ahead;
    const bool is_hidden = (r > c.hidden_beyond) & (q > c.hidden_first) & (q < c.hidden_last);
    const bool may_show = is_ahead & !is_hidden;
    // at any range it shifts each band by its elevation
    const float by_elevation = (c.across0 + r * c.across1) * std::sqrt(ahead * ahead + left * left) / (ahead * ahead);
    float sum = 0, bands = 0;
#pragma GCC unroll 4
    for (int b = 0; b < kLevelBands; ++b) {
      const float x = (q + by_elevation * other.elevation[b] - q_first) * by_step;
      const bool is_inside = may_show & (x >= 0) & (x < last);
      const float held = is_inside ? x : 0;
      const int at = static_cast<int>(held);
      const float share = held - static_cast<float>(at);
      const float v0 = other.value[b][at], s0 = other.slope[b][at];
      const float v = v0 + share * (other.value[b][at + 1] - v0), s = s0 + share * (other.slope[b][at + 1] - s0);
      const float dv = (v - column.value[b]) * by_value, ds = (s - column.slope[b]) * by_slope;
      const bool is_shown = is_inside & (dv == dv) & (ds == ds); // not NaN
      sum += is_shown ? std::min(dv * dv, 4.f) + std::min(ds * ds, 4.f) : 0;
      bands += is_shown ? 1.f : 0.f;
    }
    differences[i] = bands > 0 ? 0.5f * sum / std::max(bands, 1.f) : -1;
  }
}
} // namespace bole
