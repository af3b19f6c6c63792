// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a least-squares solver wants of a summary factor: a whitened residual, and a word on
/// whether the quadratic is one at all.
///
/// Idea: with F = V Lambda V^T and d = theta^r (-) optimum, Eq. 9 is
///   constant + 1/2 |S d + b|^2,  S = Lambda^1/2 V^T,  b = Lambda^-1/2 V^T f,
/// where directions with a vanishing eigenvalue carry no information and drop out of both.

#include <bole/summary_factor.h>

namespace bole
{
/// Eigenvalues of F above -kIndefiniteTolerance times the largest count as zero (rounding of a
/// numeric Hessian), those below as negative curvature.
constexpr double kIndefiniteTolerance = 1e-3;
/// Eigenvalues of F below this times the largest carry no information.
constexpr double kRankTolerance = 1e-9;

/// Laws (each a test): 1/2 |residual(x)|^2 + constant == energyAt(x) for positive definite F;
/// S^T S == F for positive semi-definite F; squareRoot(factor()) is the same quadratic.
struct SquareRootSummary
{
  RelativeTrunk optimum;
  Matrix4d S = Matrix4d::Zero(); ///< S^T S = F
  Vector4d b = Vector4d::Zero();
  double constant = 0; ///< the energy no parameter can change

  /// Whitened residual at \p relative; \p J, if not null, its 4x4 Jacobian by the tangent of \p
  /// relative.
  Vector4d residual(const RelativeTrunk &relative, Matrix4d *J = nullptr) const;
  /// The quadratic as a summary again: what squareRoot() made this of, without directions that carry no information.
  SummaryFactor factor() const;
};

/// Fills \p root from \p factor; leaves it alone when the status is indefinite or not_finite.
SummaryStatus squareRoot(const SummaryFactor &factor, SquareRootSummary &root);
} // namespace bole
