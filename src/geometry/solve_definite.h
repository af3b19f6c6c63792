// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A x = b for a symmetric positive definite A of a few rows, by its square-root-free Cholesky factors. Their number is
/// known to the compiler, which unrolls it; Eigen's decompositions pivot and go by blocks of any size.

#include <Eigen/Core>

namespace bole
{
/// Reads the lower triangle. Not finite where A is singular.
template <int N> Eigen::Matrix<double, N, 1> solveDefinite(Eigen::Matrix<double, N, N> A, Eigen::Matrix<double, N, 1> b)
{
  Eigen::Matrix<double, N, 1> by_pivot;
  for (int j = 0; j < N; ++j) {
    by_pivot(j) = 1 / A(j, j);
    for (int i = j + 1; i < N; ++i) {
      const double share = A(i, j) * by_pivot(j);
      for (int k = j + 1; k <= i; ++k)
        A(i, k) -= share * A(k, j);
      b(i) -= share * b(j);
    }
  }
  for (int j = N - 1; j >= 0; --j) {
    for (int i = j + 1; i < N; ++i)
      b(j) -= A(i, j) * b(i);
    b(j) *= by_pivot(j);
  }
  return b;
}
} // namespace bole
