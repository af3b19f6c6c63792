// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: sums over pixels of a patch, and across a line of a gradient image.

#include "gradient/line_loops.h"

namespace bole
{
/// Of the pixels of an image under a patch, in grey levels.
struct PatchSums
{
  double sum = 0;     ///< of the pixels
  double square = 0;  ///< of their squares
  double product = 0; ///< of them and those of the patch
};

void addPatchRow(const unsigned char *pixels, const float *patch, int n, PatchSums &sums);

/// Adds, for each row from \p row on, the \p n pixels from x - \p half on, and those from half a pixel farther on,
/// linear between pixels, to \p whole and \p between. Returns the first row in which they reach beyond the image, or
/// the number of rows.
int addAcrossRows(const LineSamples &line, int row, int n, int half, float *whole, float *between);
} // namespace bole
