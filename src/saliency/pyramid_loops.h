// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: a row of an image of half the size from two rows.

namespace bole
{
/// out[j] = mean of the four pixels above and below at 2 j and 2 j + 1; bytes become 1 = full scale.
void halvedRow(const unsigned char *upper, const unsigned char *lower, int width, float *out);
void halvedRow(const float *upper, const float *lower, int width, float *out);
} // namespace bole
