// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Robust losses: how much a residual that is far too large may still pull.

#include <string>

namespace bole
{
enum class LossKind
{
  quadratic, ///< rho(s) = s
  huber,     ///< s below width^2, then 2 width sqrt(s) - width^2
  cauchy     ///< width^2 log(1 + s / width^2): a gross outlier pulls less and less
};
const char *toString(LossKind kind);
/// Throws vpException(badValue) for an unknown name.
LossKind lossKindFromString(const std::string &name);

/// rho(s) of the squared whitened residual s; a factor costs rho(s) / 2.
///
/// Laws (each a test): rho(0) == 0; weight is the derivative of rho; weight(0) == 1; weight never
/// rises.
struct Loss
{
  LossKind kind = LossKind::quadratic;
  double width = 3; ///< in standard deviations, > 0

  double rho(double s) const;
  double weight(double s) const; ///< rho'(s)
};
} // namespace bole
