// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/factors.h>

#include "geometry/names.h"

#include <cmath>
#include <visp3/core/vpException.h>

namespace bole
{
const char *toString(LossKind kind) { return nameOf(kind, {"quadratic", "huber", "cauchy"}); }

LossKind lossKindFromString(const std::string &name)
{
  if (const auto kind = valueNamed(name, LossKind::cauchy))
    return *kind;
  throw vpException(vpException::badValue, "loss = %s, must be quadratic, huber or cauchy", name.c_str());
}

double Loss::rho(double s) const
{
  const double w2 = width * width;
  if (kind == LossKind::huber && s > w2)
    return 2 * width * std::sqrt(s) - w2;
  if (kind == LossKind::cauchy)
    return w2 * std::log1p(s / w2);
  return s;
}

double Loss::weight(double s) const
{
  const double w2 = width * width;
  if (kind == LossKind::huber && s > w2)
    return width / std::sqrt(s);
  if (kind == LossKind::cauchy)
    return 1 / (1 + s / w2);
  return 1;
}
} // namespace bole
