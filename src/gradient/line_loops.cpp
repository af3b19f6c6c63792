// SPDX-License-Identifier: GPL-2.0-or-later
#include "gradient/line_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>

namespace bole
{
BOLE_VECTOR_CLONES
CubicSums cubicSumsAlong(const LineSamples &line)
{
  const float *pixels = line.pixels;
  const int columns = line.columns, rows = line.rows;
  const double x_top = line.x_top, along = line.slope;
  double value = 0, slope = 0, slope_by_row = 0;
#pragma omp simd reduction(+ : value, slope, slope_by_row)
  for (int i = 0; i < rows; ++i) {
    const double x = x_top + along * i;
    const bool is_inside = (x >= 1) & (x < columns - 2);
    const double held = is_inside ? x : 1;
    const int column = static_cast<int>(held), at = i * columns + column - 1;
    const double p0 = pixels[at], p1 = pixels[at + 1], p2 = pixels[at + 2], p3 = pixels[at + 3];
    const double t = held - column, share = is_inside ? 1 : 0;
    const double c1 = 0.5 * (p2 - p0), c2 = p0 - 2.5 * p1 + 2 * p2 - 0.5 * p3, c3 = 0.5 * (p3 - p0) + 1.5 * (p1 - p2);
    const double across = share * (c1 + t * (2 * c2 + t * 3 * c3));
    value += share * (p1 + t * (c1 + t * (c2 + t * c3)));
    slope += across;
    slope_by_row += across * i;
  }
  return {value, slope, slope_by_row};
}

BOLE_VECTOR_CLONES
double linearSumAlong(const LineSamples &line)
{
  const float *pixels = line.pixels;
  const int columns = line.columns, rows = line.rows;
  const float x_top = static_cast<float>(line.x_top), along = static_cast<float>(line.slope),
              end = static_cast<float>(columns - 1);
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
  return static_cast<double>(sum);
}

BOLE_VECTOR_CLONES
LinearSums linearSumsBeside(const LineSamples &line)
{
  const float *pixels = line.pixels;
  const int columns = line.columns, rows = line.rows;
  const double x_top = line.x_top, along = line.slope, last = columns - 1 - 1e-9;
  double left = 0, middle = 0, right = 0;
  const auto sample = [=](int i, double x) {
    const double held = std::max(0.0, std::min(x, last)), share = held == x ? 1 : 0; // 0 for NaN
    const int column = static_cast<int>(held), at = i * columns + column;
    const double p0 = pixels[at], p1 = pixels[at + 1];
    return share * (p0 + (held - column) * (p1 - p0));
  };
#pragma omp simd reduction(+ : left, middle, right)
  for (int i = 0; i < rows; ++i) {
    const double x = x_top + along * i;
    left += sample(i, x - 1);
    middle += sample(i, x);
    right += sample(i, x + 1);
  }
  return {left, middle, right};
}
} // namespace bole
