// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/tracking_loops.h"

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

namespace
{
/// Adds the \p n pixels from \p share behind the first on, and those from half a pixel farther on.
inline void addRow(const float *pixels, int n, float share, float *__restrict whole, float *__restrict between)
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
} // namespace

BOLE_VECTOR_CLONES
int addAcrossRows(const LineSamples &line, int row, int n, int half, float *__restrict whole, float *__restrict between)
{
  const double x_top = line.x_top, slope = line.slope;
  const int columns = line.columns, rows = line.rows;
  for (; row < rows; ++row) {
    const double x = x_top + slope * row;
    if (!(x >= half && x < columns))
      break;
    const int left = static_cast<int>(x), first = left - half;
    if (first + n + 2 >= columns)
      break;
    addRow(line.pixels + row * columns + first, n, static_cast<float>(x - left), whole, between);
  }
  return row;
}
} // namespace bole
