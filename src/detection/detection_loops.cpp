// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/detection_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <cmath>

namespace bole
{
BOLE_VECTOR_CLONES
BorderSums sumsOfBorders(const ViewColumns &views, const Circle &circle, float px_per_q, float gate_px)
{
  constexpr float kLeastAhead = 0.2f, kMostBeside = 0.9f; // a circle beside the camera, or round it, has no borders
  const int n = static_cast<int>(views.x.size());
  const float *vx = views.x.data(), *vy = views.y.data(), *fx = views.forward_x.data(), *fy = views.forward_y.data();
  const float *lx = views.left_x.data(), *ly = views.left_y.data(), *by_step = views.by_step.data();
  const float *first = views.q_first.data(), *last = views.q_last.data();
  const int *sample = views.first_sample.data();
  const float *peaks_left = (circle.left_rises ? views.rising_peak : views.falling_peak).data();
  const float *peaks_right = (circle.right_rises ? views.rising_peak : views.falling_peak).data();
  const float x = circle.x, y = circle.y, r = circle.r;
  float h00 = 0, h01 = 0, h02 = 0, h11 = 0, h12 = 0, h22 = 0, g0 = 0, g1 = 0, g2 = 0;
  float seen = 0, inliers = 0, squares = 0;
#pragma omp simd reduction(+ : h00, h01, h02, h11, h12, h22, g0, g1, g2, seen, inliers, squares)
  for (int i = 0; i < n; ++i) {
    const float wx = x - vx[i], wy = y - vy[i], d2 = wx * wx + wy * wy;
    const float ahead = fx[i] * wx + fy[i] * wy, beside = lx[i] * wx + ly[i] * wy;
    const bool is_outside = (ahead >= kLeastAhead) & (d2 > 1.2f * r * r);
    const float q = beside / (is_outside ? ahead : 1), t = r / std::sqrt(is_outside ? d2 - r * r : 1);
    const float qt = q * t, left = (q + t) / (1 - qt), right = (q - t) / (1 + qt);
    const bool is_seen = is_outside & (qt <= kMostBeside) & (qt >= -kMostBeside) & (left >= first[i]) &
                         (left <= last[i]) & (right >= first[i]) & (right <= last[i]);
    const float at_left = is_seen ? (left - first[i]) * by_step[i] + 0.5f : 0;
    const float at_right = is_seen ? (right - first[i]) * by_step[i] + 0.5f : 0;
    const float peak_left = peaks_left[sample[i] + static_cast<int>(at_left)];
    const float peak_right = peaks_right[sample[i] + static_cast<int>(at_right)];
    const float off_left = (left - peak_left) * px_per_q, off_right = (right - peak_right) * px_per_q;
    const bool has_left = is_seen & (std::abs(off_left) < gate_px); // false for NaN
    const bool has_right = is_seen & (std::abs(off_right) < gate_px);
    const float e_left = has_left ? off_left : 0, e_right = has_right ? off_right : 0;
    const float by_d2 = 1 / (is_outside ? d2 : 1), tx = t * wx * by_d2, ty = t * wy * by_d2, ox = -wy * by_d2,
                oy = wx * by_d2;
    const float slope_l = has_left ? (1 + left * left) * px_per_q : 0;
    const float slope_r = has_right ? (1 + right * right) * px_per_q : 0;
    const float l0 = (ox - tx) * slope_l, l1 = (oy - ty) * slope_l, l2 = t * slope_l;
    const float r0 = (ox + tx) * slope_r, r1 = (oy + ty) * slope_r, r2 = -t * slope_r;
    h00 += l0 * l0 + r0 * r0, h01 += l0 * l1 + r0 * r1, h02 += l0 * l2 + r0 * r2;
    h11 += l1 * l1 + r1 * r1, h12 += l1 * l2 + r1 * r2, h22 += l2 * l2 + r2 * r2;
    g0 += e_left * l0 + e_right * r0, g1 += e_left * l1 + e_right * r1, g2 += e_left * l2 + e_right * r2;
    const bool has_both = has_left & has_right;
    seen += is_seen ? 1.f : 0.f;
    inliers += has_both ? 1.f : 0.f;
    squares += has_both ? 0.5f * (e_left * e_left + e_right * e_right) : 0.f;
  }
  return {{h00, h01, h02, h11, h12, h22}, {g0, g1, g2}, seen, inliers, squares};
}

BOLE_VECTOR_CLONES
void addAgreement(const SweptView &view, float by_contrast, const float *ranges, int count, float *__restrict sum,
                  float *__restrict seen)
{
  constexpr float kLeastAhead = 0.2f;
  constexpr float kAgainst = -0.3f; // of a border of the other sign
  const float last = static_cast<float>(view.samples) - 1, ahead0 = view.ahead0, ahead1 = view.ahead1;
  const float left0 = view.left0, left1 = view.left1, q_first = view.q_first, by_step = view.by_step;
  const float *profile = view.profile;
#pragma omp simd
  for (int i = 0; i < count; ++i) {
    const float ahead = ahead0 + ranges[i] * ahead1;
    const float held = ahead >= kLeastAhead ? ahead : kLeastAhead;
    const float at = ((left0 + ranges[i] * left1) / held - q_first) * by_step;
    const float share = (held == ahead) & (at >= 0) & (at <= last) ? 1.f : 0.f;
    const float value = profile[static_cast<int>(share * at + 0.5f)] * by_contrast;
    sum[i] += share * std::min(std::max(value, kAgainst), 1.f);
    seen[i] += share;
  }
}

BOLE_VECTOR_CLONES
float scoresOfPair(const BorderCurve &left, const BorderCurve &right, int count, float views_min,
                   float *__restrict scores)
{
  const float *left_sum = left.sum, *left_seen = left.seen, *right_sum = right.sum, *right_seen = right.seen;
  float best = -1;
#pragma omp simd reduction(max : best)
  for (int i = 0; i < count; ++i) {
    const float seen = left_seen[i] + right_seen[i], mean = (left_sum[i] + right_sum[i]) / std::max(seen, 1.f);
    scores[i] = std::min(left_seen[i], right_seen[i]) >= views_min ? mean : -1;
    best = best > scores[i] ? best : scores[i];
  }
  return best;
}

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
