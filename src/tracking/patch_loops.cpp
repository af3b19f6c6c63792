// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/patch_loops.h"

#include "geometry/vector_clones.h"

namespace bole
{
BOLE_VECTOR_CLONES
void addPatchRow(const unsigned char *pixels, const float *patch, int n, PatchSums &sums)
{
  float sum = 0, square = 0, product = 0;
#pragma omp simd reduction(+ : sum, square, product)
  for (int i = 0; i < n; ++i) {
    const auto pixel = static_cast<float>(pixels[i]);
    sum += pixel;
    square += pixel * pixel;
    product += pixel * patch[i];
  }
  sums.sum += sum;
  sums.square += square;
  sums.product += product;
}
} // namespace bole
