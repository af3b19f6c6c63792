// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/require_range.h"

#include <bole/visp.h>
#include <visp3/core/vpException.h>

namespace bole
{
void requireRange(const char *name, double value, double low, double high)
{
  if (!(value >= low && value <= high))
    throw vpException(vpException::badValue, "%s = %g, must be in [%g, %g]", name, value, low, high);
}
} // namespace bole
