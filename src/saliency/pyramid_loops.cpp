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

BOLE_VECTOR_CLONES
void gradientsOfRow(const float *above, const float *row, const float *below, int width, float scale,
                    float *__restrict gx, float *__restrict gy)
{
  for (int j = 1; j < width - 1; ++j)
    gx[j] = 0.5f * (row[j + 1] - row[j - 1]);
  gx[0] = gx[width - 1] = 0;
  for (int j = 0; j < width; ++j)
    gy[j] = scale * (below[j] - above[j]);
}
} // namespace bole
