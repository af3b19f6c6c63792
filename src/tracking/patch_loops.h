// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: sums over pixels of a patch.

namespace bole
{
/// Of the pixels of an image under a patch, in grey levels.
struct PatchSums
{
  double sum = 0;     ///< of the pixels
  double square = 0;  ///< of their squares
  double product = 0; ///< of them and those of the patch
};

/// Adds the \p n pixels of a row.
void addPatchRow(const unsigned char *pixels, const float *patch, int n, PatchSums &sums);
} // namespace bole
