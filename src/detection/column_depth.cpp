// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/column_depth.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr std::uint8_t kUnseen = 255;
constexpr float kMost = 250;                     ///< cost of what is not the same
constexpr float kMostGrey = 24, kMostSlope = 16; ///< differences beyond which two pieces are simply not the same
} // namespace

ColumnDepth::ColumnDepth(const LevelImage &frame, const std::vector<const LevelImage *> &beside,
                         const DepthSweep &sweep)
    : m_sweep(sweep), m_grid(frame.grid()), m_columns(frame.columns())
{
  m_cost.assign(static_cast<std::size_t>(m_columns * sweep.steps * sweep.bands), kUnseen);
  for (const LevelImage *other : beside)
    match(frame, *other);
}

void ColumnDepth::match(const LevelImage &frame, const LevelImage &other)
{
  const int rows = m_grid.rows, bands = m_sweep.bands;
  const Eigen::Vector3d offset = frame.wMc().t - other.wMc().t;
  const auto size = static_cast<std::size_t>(rows);
  std::vector<float> slope(size), there_grey(size), there_slope(size);
  for (int c = 1; c + 1 < m_columns; ++c) {
    const LevelImage::Span span = frame.span(c);
    const double bearing = frame.bearingOf(c);
    const Eigen::Vector2d direction(std::cos(bearing), std::sin(bearing));
    const float *here = frame.grey(c), *right = frame.grey(c - 1), *left = frame.grey(c + 1);
    for (std::size_t r = 0; r < size; ++r)
      slope[r] = 0.5f * (left[r] - right[r]);
    for (int s = 0; s < m_sweep.steps; ++s) {
      constexpr double kFarthest = 1e3; // in inverse ranges [m]
      const double range = 1 / std::max(m_sweep.inverseOf(s), 1 / kFarthest);
      const Eigen::Vector2d there = offset.head<2>() + range * direction;
      const double there_range = there.norm();
      const double column = other.columnOf(std::atan2(there.y(), there.x()));
      const int i = static_cast<int>(std::floor(column));
      if (i < 1 || i + 2 >= other.columns())
        continue;
      // row there = scale * row here + shift
      const double scale = range / there_range;
      const double shift = ((m_grid.tan_low * range + offset.z()) / there_range - m_grid.tan_low) / m_grid.row_step;
      const LevelImage::Span s1 = other.span(i), s2 = other.span(i + 1);
      const int first = std::max(s1.begin, s2.begin), last = std::min(s1.end, s2.end) - 1;
      const int begin = std::max<int>(span.begin, static_cast<int>(std::ceil((first - shift) / scale)));
      const int end = std::min<int>(span.end, static_cast<int>(std::floor((last - shift) / scale)));
      if (end <= begin)
        continue;
      const auto a = static_cast<float>(column - i);
      const float *o0 = other.grey(i - 1), *o1 = other.grey(i), *o2 = other.grey(i + 1), *o3 = other.grey(i + 2);
      for (std::size_t r = 0; r < size; ++r) {
        there_grey[r] = o1[r] + a * (o2[r] - o1[r]);
        there_slope[r] = 0.5f * ((1 - a) * (o2[r] - o0[r]) + a * (o3[r] - o1[r]));
      }
      for (int band = 0; band < bands; ++band) {
        const int from = rows * band / bands, to = rows * (band + 1) / bands;
        const int b = std::max(from, begin), e = std::min(to, end);
        if (e - b < (to - from) / 2)
          continue;
        float sum = 0;
        for (int r = b; r < e; ++r) {
          const auto y = static_cast<float>(scale * r + shift);
          const auto k = static_cast<std::size_t>(y);
          const float w = y - static_cast<float>(k);
          const float d = here[r] - there_grey[k] - w * (there_grey[k + 1] - there_grey[k]);
          const float g =
              slope[static_cast<std::size_t>(r)] - there_slope[k] - w * (there_slope[k + 1] - there_slope[k]);
          sum += std::min(std::abs(d) / kMostGrey, 1.f) + std::min(std::abs(g) / kMostSlope, 1.f);
        }
        auto &cost = m_cost[static_cast<std::size_t>((c * m_sweep.steps + s) * bands + band)];
        cost = std::min(cost, static_cast<std::uint8_t>(0.5f * kMost * sum / static_cast<float>(e - b)));
      }
    }
  }
}

double ColumnDepth::cost(int column, int step, double tan_low, double tan_high) const
{
  if (column < 0 || column >= m_columns || step < 0 || step >= m_sweep.steps)
    return -1;
  const double per_band = static_cast<double>(m_grid.rows) / m_sweep.bands;
  const double low = m_grid.rowOf(tan_low) / per_band, high = m_grid.rowOf(tan_high) / per_band;
  const std::uint8_t *costs = &m_cost[static_cast<std::size_t>((column * m_sweep.steps + step) * m_sweep.bands)];
  double sum = 0, weight = 0;
  for (int band = 0; band < m_sweep.bands; ++band) {
    const double share = std::min(high, band + 1.0) - std::max(low, static_cast<double>(band));
    if (share <= 0 || costs[band] == kUnseen)
      continue;
    sum += share * costs[band] / static_cast<double>(kMost);
    weight += share;
  }
  return weight > 0.5 * std::min(high - low, 1.0) ? sum / weight : -1;
}
} // namespace bole
