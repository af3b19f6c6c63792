// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: one row of a separable filter, pair of taps by pair of taps.

namespace bole
{
/// sum[j] = or += weight (above[j] + below[j]).
void addPairOfRows(const unsigned char *above, const unsigned char *below, float weight, bool is_first, int width,
                   float *sum);

/// out[j] = or += weight (in[j + reach] - in[j - reach]).
void addDifferenceAcross(const float *in, int reach, float weight, bool is_first, int width, float *out);
} // namespace bole
