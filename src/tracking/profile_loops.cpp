// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/profile_loops.h"

#include "geometry/vector_clones.h"

namespace bole
{
BOLE_VECTOR_CLONES
void addAcrossRow(const float *pixels, int n, float share, float *__restrict whole, float *__restrict between)
{
  const bool is_past = share >= 0.5f; // half a pixel on is beyond the next column
  const float *half_on = is_past ? pixels + 1 : pixels, later = is_past ? share - 0.5f : share + 0.5f;
  const float before = 1 - share, earlier = 1 - later;
#pragma omp simd
  for (int k = 0; k < n; ++k) {
    whole[k] += before * pixels[k] + share * pixels[k + 1];
    between[k] += earlier * half_on[k] + later * half_on[k + 1];
  }
}
} // namespace bole
