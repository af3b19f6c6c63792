// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Summary factor: a quadratic in the relative trunk that replaces the image of one trunk for ever.
///
/// Idea: the image energy of a trunk depends on pose and trunk only through the relative trunk theta^r.
/// At its optimum it is well approximated by a quadratic there, while the map from (pose, trunk) to
/// theta^r keeps all the non-linearity and is cheap to compute again. So past images need never be
/// touched, and nothing but the image is linearised (paper, Section 4.2, Eq. 9).
///
/// Deviation: Eq. 9 prints `e + f d + d^T F d` with F "the Hessian"; here the consistent form
/// e + f^T d + 1/2 d^T F d, with d = theta^r (-) optimum.

#include <bole/trunk.h>

namespace bole
{
/// Laws (each a test): energyAt(optimum) == energy; the gradient of energyAt at the optimum is f.
/// Energy is a negative log-likelihood (calibrated: F is an information matrix in the tangent of theta^r).
struct SummaryFactor
{
  RelativeTrunk optimum;             ///< hat theta^r, the centre of the approximation
  double energy = 0;                 ///< e
  Vector4d f = Vector4d::Zero();     ///< gradient of the energy at its minimum
  Matrix4d F = Matrix4d::Identity(); ///< symmetric, positive semi-definite

  /// Value of the quadratic at another relative trunk (Eq. 9).
  double energyAt(const RelativeTrunk &relative) const;
};

/// What became of a summary factor that was handed to the smoother.
enum class SummaryStatus
{
  ok,
  projected,  ///< an eigenvalue just below zero was set to zero
  indefinite, ///< clearly negative curvature: not a minimum, the view must be dropped (paper,
              ///< Section 7)
  not_finite  ///< NaN or infinity, or an optimum that is no rotation or has r >= d
};
/// As reports write it.
const char *toString(SummaryStatus status);
} // namespace bole
