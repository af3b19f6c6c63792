// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/pyramid_loops.h"

#include "geometry/vector_clones.h"

namespace bole
{
BOLE_VECTOR_CLONES
void halvedRow(const unsigned char *upper, const unsigned char *lower, int width, float *__restrict out)
{
  for (int j = 0; j < width; ++j) {
    const int sum = upper[2 * j] + upper[2 * j + 1] + lower[2 * j] + lower[2 * j + 1];
    out[j] = (0.25f / 255.f) * static_cast<float>(sum);
  }
}

BOLE_VECTOR_CLONES
void halvedRow(const float *upper, const float *lower, int width, float *__restrict out)
{
  for (int j = 0; j < width; ++j)
    out[j] = 0.25f * (upper[2 * j] + upper[2 * j + 1] + lower[2 * j] + lower[2 * j + 1]);
}
} // namespace bole
