// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/median.h"

#include <algorithm>

namespace bole
{
double medianOf(std::vector<double> values)
{
  if (values.empty())
    return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}
} // namespace bole
