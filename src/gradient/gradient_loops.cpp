// SPDX-License-Identifier: GPL-2.0-or-later
#include "gradient/gradient_loops.h"

#include "geometry/vector_clones.h"

namespace bole
{
BOLE_VECTOR_CLONES
void addPairOfRows(const unsigned char *above, const unsigned char *below, float weight, bool is_first, int width,
                   float *__restrict sum)
{
  if (is_first)
    for (int j = 0; j < width; ++j)
      sum[j] = weight * static_cast<float>(above[j] + below[j]);
  else
    for (int j = 0; j < width; ++j)
      sum[j] += weight * static_cast<float>(above[j] + below[j]);
}

BOLE_VECTOR_CLONES
void addDifferenceAcross(const float *in, int reach, float weight, bool is_first, int width, float *__restrict out)
{
  const float *left = in - reach, *right = in + reach;
  if (is_first)
    for (int j = 0; j < width; ++j)
      out[j] = weight * (right[j] - left[j]);
  else
    for (int j = 0; j < width; ++j)
      out[j] += weight * (right[j] - left[j]);
}
} // namespace bole
