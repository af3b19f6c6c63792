// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: sums across a line of a gradient image.

namespace bole
{
/// Adds the \p n pixels from x on, and those from half a pixel farther on, linear between pixels, to \p whole and
/// \p between. \p pixels: n + 3 of them, the first at the last whole column before x; \p share: how far x is from it.
void addAcrossRow(const float *pixels, int n, float share, float *whole, float *between);
} // namespace bole
