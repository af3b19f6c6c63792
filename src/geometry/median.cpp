// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/median.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

Eigen::Vector2d medianByAxis(const std::vector<Eigen::Vector2d> &values)
{
  std::vector<double> x, y;
  for (const Eigen::Vector2d &value : values) {
    x.push_back(value.x());
    y.push_back(value.y());
  }
  return {medianOf(std::move(x)), medianOf(std::move(y))};
}

double centreOf(std::vector<double> values)
{
  if (values.empty())
    return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return values.size() % 2 == 1 ? *middle : 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

double quantileOf(std::vector<double> values, double share)
{
  if (values.empty())
    return std::numeric_limits<double>::quiet_NaN();
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double peakOffset(double before, double middle, double after)
{
  const double bend = before - 2 * middle + after;
  return bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
}
} // namespace bole
