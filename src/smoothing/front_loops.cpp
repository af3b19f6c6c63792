// SPDX-License-Identifier: GPL-2.0-or-later
#include "smoothing/normal_equations.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr int kPanel = 6; ///< columns that are taken from the rest at a time

/// \p front: from its first diagonal element on, of \p rows rows that stand \p ld apart.
int factorPanel(double *front, int ld, int rows, int columns)
{
  int held = 0;
  for (int c = 0; c < columns; ++c) {
    double *column = front + c * ld;
    const double before = column[c];
    for (int k = 0; k < c; ++k) {
      const double *earlier = front + k * ld;
      const double scale = earlier[c];
      for (int i = c; i < rows; ++i)
        column[i] -= scale * earlier[i];
    }
    if (!(column[c] > 1e-13 * std::abs(before)) || !std::isfinite(column[c])) {
      ++held;
      std::fill(column + c, column + rows, 0.0);
      column[c] = 1;
      continue;
    }
    const double inverse = 1 / std::sqrt(column[c]);
    for (int i = c; i < rows; ++i)
      column[i] *= inverse;
  }
  return held;
}

/// Takes the products of the first Columns columns from the others.
template <int Columns> [[gnu::always_inline]] inline void subtractProducts(double *front, int ld, int rows)
{
  for (int j = Columns; j < rows - 1; ++j) {
    double w[Columns];
    for (int k = 0; k < Columns; ++k)
      w[k] = front[k * ld + j];
    double *column = front + j * ld;
#pragma omp simd
    for (int i = j; i < rows; ++i) {
      double sum = 0;
      for (int k = 0; k < Columns; ++k)
        sum += w[k] * front[k * ld + i];
      column[i] -= sum;
    }
  }
}

BOLE_VECTOR_CLONES
void subtractProductsOf(double *front, int ld, int rows, int columns)
{
  switch (columns) {
  case 1:
    return subtractProducts<1>(front, ld, rows);
  case 2:
    return subtractProducts<2>(front, ld, rows);
  case 3:
    return subtractProducts<3>(front, ld, rows);
  case 4:
    return subtractProducts<4>(front, ld, rows);
  case 5:
    return subtractProducts<5>(front, ld, rows);
  default:
    return subtractProducts<kPanel>(front, ld, rows);
  }
}
} // namespace

int factorFront(double *front, int ld, int columns)
{
  int held = 0;
  for (int at = 0; at < columns; at += kPanel) {
    double *panel = front + static_cast<std::ptrdiff_t>(at) * (ld + 1);
    const int width = std::min(kPanel, columns - at);
    held += factorPanel(panel, ld, ld - at, width);
    subtractProductsOf(panel, ld, ld - at, width);
  }
  return held;
}
} // namespace bole
