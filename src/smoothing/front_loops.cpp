// SPDX-License-Identifier: GPL-2.0-or-later
#include "smoothing/front_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
int factorColumns(double *front, int ld, int columns)
{
  int held = 0;
  for (int c = 0; c < columns; ++c) {
    double *column = front + c * ld;
    const double before = column[c];
    for (int k = 0; k < c; ++k) {
      const double *earlier = front + k * ld;
      const double scale = earlier[c];
      for (int i = c; i < ld; ++i)
        column[i] -= scale * earlier[i];
    }
    if (!(column[c] > 1e-13 * std::abs(before)) || !std::isfinite(column[c])) {
      ++held;
      std::fill(column + c, column + ld, 0.0);
      column[c] = 1;
      continue;
    }
    const double inverse = 1 / std::sqrt(column[c]);
    for (int i = c; i < ld; ++i)
      column[i] *= inverse;
  }
  return held;
}

/// Takes the products of the first Columns columns from the others.
template <int Columns> [[gnu::always_inline]] inline void subtractProducts(double *front, int ld)
{
  for (int j = Columns; j < ld - 1; ++j) {
    double w[Columns];
    for (int k = 0; k < Columns; ++k)
      w[k] = front[k * ld + j];
    double *column = front + j * ld;
#pragma omp simd
    for (int i = j; i < ld; ++i) {
      double sum = 0;
      for (int k = 0; k < Columns; ++k)
        sum += w[k] * front[k * ld + i];
      column[i] -= sum;
    }
  }
}

BOLE_VECTOR_CLONES
void subtractProductsOf5(double *front, int ld) { subtractProducts<5>(front, ld); }

BOLE_VECTOR_CLONES
void subtractProductsOf6(double *front, int ld) { subtractProducts<6>(front, ld); }

template <typename Number>
[[gnu::always_inline]] inline double sumOfProducts(const Number *a, const double *b, int count)
{
  double sum = 0;
#pragma omp simd reduction(+ : sum)
  for (int i = 0; i < count; ++i)
    sum += a[i] * b[i];
  return sum;
}
} // namespace

BOLE_VECTOR_CLONES
double product(const double *a, const double *b, int count) { return sumOfProducts(a, b, count); }

BOLE_VECTOR_CLONES
double product(const float *a, const double *b, int count) { return sumOfProducts(a, b, count); }

int factorFront(double *front, int ld, int columns)
{
  const int held = factorColumns(front, ld, columns);
  (columns == 6 ? subtractProductsOf6 : subtractProductsOf5)(front, ld);
  return held;
}
} // namespace bole
