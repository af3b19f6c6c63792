// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/summary_factor.h>

namespace bole
{
double SummaryFactor::energyAt(const RelativeTrunk &relative) const
{
  const Vector4d d = relative.minus(optimum);
  return energy + f.dot(d) + 0.5 * d.dot(F * d); // Eq. 9
}
} // namespace bole
