// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: sums across a line of a gradient image.

namespace bole
{
/// A line x = x_top + slope * row in an image of which \p pixels is the first of the line's first row.
struct AcrossLine
{
  const float *pixels;
  int columns, rows;
  double x_top, slope;
};

/// Adds, for each row from \p row on, the \p n pixels from x - \p half on, and those from half a pixel farther on,
/// linear between pixels, to \p whole and \p between. Returns the first row in which they reach beyond the image, or
/// the number of rows.
int addAcrossRows(const AcrossLine &line, int row, int n, int half, float *whole, float *between);
} // namespace bole
