// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/median_interval.h"

#include "geometry/median.h"
#include "lab/simulation/random.h"

#include <algorithm>
#include <cmath>

namespace bole
{
MedianInterval bootstrapMedian(std::vector<double> values, int resamples, std::uint64_t seed)
{
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return std::isnan(v); }), values.end());
  MedianInterval interval;
  interval.count = values.size();
  if (values.size() < 2) { // one run says nothing of the others
    interval.median = values.empty() ? interval.median : values.front();
    return interval;
  }
  std::sort(values.begin(), values.end()); // the order of the runs must not matter
  Random random(seed, 801);
  std::vector<double> medians, drawn(values.size());
  for (int k = 0; k < resamples; ++k) {
    for (double &value : drawn)
      value = values[static_cast<std::size_t>(random.uniform() * static_cast<double>(values.size()))];
    medians.push_back(centreOf(drawn));
  }
  interval.median = centreOf(values);
  if (medians.empty())
    medians.push_back(interval.median);
  interval.low = std::min(interval.median, quantileOf(medians, 0.025));
  interval.high = std::max(interval.median, quantileOf(medians, 0.975));
  return interval;
}

ShareInterval wilson(int successes, int runs)
{
  if (runs <= 0)
    return {};
  constexpr double z = 1.959964;
  const double n = runs, p = successes / n, scale = 1 / (1 + z * z / n);
  const double middle = scale * (p + z * z / (2 * n));
  const double half = scale * z * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  return {p, std::max(0.0, middle - half), std::min(1.0, middle + half)};
}
} // namespace bole
