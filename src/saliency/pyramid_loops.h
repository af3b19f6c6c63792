// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: rows of an image of half the size, and of the gradient of an image.

namespace bole
{
/// out[j] = mean of the four pixels above and below at 2 j and 2 j + 1; bytes become 1 = full scale.
void halvedRow(const unsigned char *upper, const unsigned char *lower, int width, float *out);
void halvedRow(const float *upper, const float *lower, int width, float *out);

/// Central differences of a row, along it (none at its ends) and to those \p above and \p below times \p scale.
void gradientsOfRow(const float *above, const float *row, const float *below, int width, float scale, float *gx,
                    float *gy);
} // namespace bole
