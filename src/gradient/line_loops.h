// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage and to tracking: sums of a gradient image along a line, a sample a row.

namespace bole
{
/// Samples at x = x_top + slope i of the rows i of \p pixels, which are \p columns wide.
struct LineSamples
{
  const float *pixels;
  int columns, rows;
  double x_top, slope;
};

/// Sum of the samples, cubic between columns (Catmull and Rom: with linear interpolation the optimum of an upright line
/// would snap to whole columns), and of their slopes, plain and times the row.
struct CubicSums
{
  double value = 0, slope = 0, slope_by_row = 0;
};
CubicSums cubicSumsAlong(const LineSamples &line);

/// Sum of the samples, linear between columns.
double linearSumAlong(const LineSamples &line);

/// The same of the line and of its neighbours a column to the left and to the right.
struct LinearSums
{
  double left, middle, right;
};
LinearSums linearSumsBeside(const LineSamples &line);
} // namespace bole
