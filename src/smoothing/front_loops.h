// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: the elimination of some variables from their front.

namespace bole
{
/// Cholesky of the first \p columns of a front of \p ld rows and one column less, in place: L_vv over L_sv (with y_v^T
/// in the last row), the Schur complement in the rest. Reads and writes the lower triangle alone. Returns how many
/// directions had no information beyond rounding; those are held (their step is zero).
int factorFront(double *front, int ld, int columns);
} // namespace bole
