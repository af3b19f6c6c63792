// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: the elimination of one variable from its front.

namespace bole
{
/// Cholesky of the first \p columns, 5 or 6, of a front of \p ld rows and one column less, in place: L_vv over L_sv
/// (with y_v^T in the last row), the Schur complement in the rest. Reads and writes the lower triangle alone. Returns
/// how many directions had no information beyond rounding; those are held (their delta is zero).
int factorFront(double *front, int ld, int columns);

/// Sum of a[i] b[i], i < \p count.
double product(const double *a, const double *b, int count);
double product(const float *a, const double *b, int count);
} // namespace bole
