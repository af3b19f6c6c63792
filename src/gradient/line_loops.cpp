// SPDX-License-Identifier: GPL-2.0-or-later
#include "gradient/line_loops.h"

#include "geometry/vector_clones.h"

namespace bole
{
BOLE_VECTOR_CLONES
CubicSums cubicSumsAlong(const LineSamples &line)
{
  const float *pixels = line.pixels;
  const int columns = line.columns, rows = line.rows;
  const float x_top = line.x_top, along = line.slope, last = static_cast<float>(columns - 2);
  float value = 0, slope = 0, slope_by_row = 0;
#pragma omp simd reduction(+ : value, slope, slope_by_row)
  for (int i = 0; i < rows; ++i) {
    const float row = static_cast<float>(i), x = x_top + along * row;
    const bool is_inside = (x >= 1) & (x < last);
    const float held = is_inside ? x : 1;
    const int column = static_cast<int>(held), at = i * columns + column - 1;
    const float p0 = pixels[at], p1 = pixels[at + 1], p2 = pixels[at + 2], p3 = pixels[at + 3];
    const float t = held - static_cast<float>(column), share = is_inside ? 1.f : 0.f;
    const float c1 = 0.5f * (p2 - p0), c3 = 0.5f * (p3 - p0) + 1.5f * (p1 - p2), c2 = p2 - p1 - c1 - c3;
    const float across = share * (c1 + t * (2 * c2 + t * 3 * c3));
    value += share * (p1 + t * (c1 + t * (c2 + t * c3)));
    slope += across;
    slope_by_row += across * row;
  }
  return {value, slope, slope_by_row};
}

BOLE_VECTOR_CLONES
float linearSumAlong(const LineSamples &line)
{
  const float *pixels = line.pixels;
  const int columns = line.columns, rows = line.rows;
  const float x_top = line.x_top, along = line.slope, end = static_cast<float>(columns - 1);
  float sum = 0;
#pragma omp simd reduction(+ : sum)
  for (int i = 0; i < rows; ++i) {
    const float x = x_top + along * static_cast<float>(i);
    const bool is_inside = (x >= 0) & (x < end); // false for NaN
    const float held = is_inside ? x : 0, share = is_inside ? 1.f : 0.f;
    const int column = static_cast<int>(held), at = i * columns + column;
    const float p0 = pixels[at], p1 = pixels[at + 1];
    sum += share * (p0 + (held - static_cast<float>(column)) * (p1 - p0));
  }
  return sum;
}
} // namespace bole
