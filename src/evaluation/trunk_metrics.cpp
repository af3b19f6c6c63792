// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluation/trunk_metrics.h"

#include "geometry/median.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>

namespace bole
{
namespace
{
/// Sums over what was measured.
struct Sum
{
  double sum = 0, squares = 0;
  std::size_t count = 0;

  void add(double value)
  {
    if (std::isnan(value))
      return;
    sum += value;
    squares += value * value;
    ++count;
  }
  double mean() const { return count == 0 ? kNotMeasured : sum / static_cast<double>(count); }
  double rms() const { return count == 0 ? kNotMeasured : std::sqrt(squares / static_cast<double>(count)); }
};

TrunkMatch measure(const TrunkRecord &estimate, const TruthTrunk &truth, const TrunkVisibility &visibility,
                   const Alignments &alignments)
{
  TrunkMatch match;
  match.estimate = estimate;
  match.truth_id = truth.id;
  match.visibility = visibility;
  for (std::size_t a = 0; a < alignments.size(); ++a)
    match.error[a] = (alignments[a] * estimate.xy - truth.xy).norm();
  match.nees_half = halfNees(estimate.xy, estimate.covarianceXy(), truth.xy, at(alignments, Alignment::first_pose));
  match.predicted_sigma = estimate.positionSigma();
  if (truth.radius > 0) {
    match.truth_radius = truth.radius;
    match.radius_error = estimate.radius - truth.radius;
  }
  return match;
}

/// Figures of the matches and of the expected trunks of the truth that \p counts.
TrunkErrors summarize(const TrunkMetrics &metrics, const std::function<bool(const TrunkVisibility &)> &counts)
{
  TrunkErrors errors;
  std::array<std::vector<double>, 4> distances;
  Sum nees, sigma, radius;
  for (const TrunkMatch &match : metrics.matches) {
    if (!counts(match.visibility))
      continue;
    ++errors.matches;
    errors.found += match.visibility.is_expected ? 1 : 0;
    for (std::size_t a = 0; a < distances.size(); ++a)
      distances[a].push_back(match.error[a]);
    nees.add(match.nees_half);
    sigma.add(match.predicted_sigma);
    radius.add(match.radius_error);
  }
  errors.expected = errors.found + static_cast<std::size_t>(
                                       std::count_if(metrics.misses.begin(), metrics.misses.end(),
                                                     [&](const Unmatched &miss) { return counts(miss.visibility); }));
  for (std::size_t a = 0; a < distances.size(); ++a) {
    Sum distance;
    for (const double value : distances[a])
      distance.add(value);
    errors.rmse[a] = distance.rms();
    errors.median[a] = centreOf(distances[a]);
  }
  errors.nees_half = nees.mean();
  errors.predicted_sigma = sigma.rms();
  errors.radius_bias = radius.mean();
  errors.radius_rmse = radius.rms();
  return errors;
}

std::vector<TrunkBin> binned(const TrunkMetrics &metrics, const std::vector<double> &limits, const std::string &unit,
                             double TrunkVisibility::*value)
{
  std::vector<TrunkBin> bins;
  for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
    const double from = limits[i], to = limits[i + 1];
    const auto number = [](double v) { return std::to_string(std::lround(v)); };
    const std::string name =
        to > 1e3 ? number(from) + " " + unit + " or more" : number(from) + " to " + number(to) + " " + unit;
    bins.push_back({name, summarize(metrics, [=](const TrunkVisibility &seen) {
                      return seen.frames > 0 && seen.*value >= from && seen.*value < to;
                    })});
  }
  bins.push_back({"never in view", summarize(metrics, [](const TrunkVisibility &seen) { return seen.frames == 0; })});
  return bins;
}

/// Nearest of \p count points to \p point.
template <typename Position>
void findNearest(Unmatched &entry, const Eigen::Vector2d &point, std::size_t count, const Position &position,
                 std::size_t &index)
{
  entry.nearest_distance = count == 0 ? kNotMeasured : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    const double distance = (position(i) - point).norm();
    if (distance < entry.nearest_distance) {
      entry.nearest_distance = distance;
      index = i;
    }
  }
}
} // namespace

double TrunkErrors::recall() const
{
  return expected == 0 ? kNotMeasured : static_cast<double>(found) / static_cast<double>(expected);
}

Alignments alignAll(const std::vector<PosePair> &pairs)
{
  Alignments alignments;
  for (std::size_t a = 0; a < alignments.size(); ++a)
    alignments[a] = align(pairs, static_cast<Alignment>(a));
  return alignments;
}

TrunkMetrics trunkMetrics(const std::vector<TrunkRecord> &map, const std::vector<TruthTrunk> &truth,
                          const std::vector<TrunkVisibility> &visibility, const Alignments &alignments,
                          Alignment matching)
{
  const PlanarTransform &aligned = at(alignments, matching);
  std::vector<TrunkRecord> confirmed;
  std::copy_if(map.begin(), map.end(), std::back_inserter(confirmed),
               [](const TrunkRecord &trunk) { return trunk.status == TrunkStatus::confirmed; });
  Eigen::MatrixXd distance(confirmed.size(), truth.size());
  for (Eigen::Index i = 0; i < distance.rows(); ++i)
    for (Eigen::Index j = 0; j < distance.cols(); ++j)
      distance(i, j) =
          (aligned * confirmed[static_cast<std::size_t>(i)].xy - truth[static_cast<std::size_t>(j)].xy).norm();
  const std::vector<int> partner = assign(distance, kMatchGate);

  TrunkMetrics metrics;
  metrics.matching = matching;
  metrics.confirmed = confirmed.size();
  std::vector<bool> is_found(truth.size(), false);
  std::size_t duplicates = 0;
  for (std::size_t i = 0; i < confirmed.size(); ++i) {
    if (partner[i] >= 0) {
      const auto j = static_cast<std::size_t>(partner[i]);
      is_found[j] = true;
      metrics.matches.push_back(measure(confirmed[i], truth[j], visibility[j], alignments));
      continue;
    }
    Unmatched extra;
    std::size_t nearest = 0;
    extra.id = confirmed[i].id;
    extra.estimate = confirmed[i];
    findNearest(
        extra, aligned * confirmed[i].xy, truth.size(), [&](std::size_t k) { return truth[k].xy; }, nearest);
    extra.nearest_id = truth.empty() ? -1 : truth[nearest].id;
    extra.is_duplicate = !truth.empty() && extra.nearest_distance <= kMatchGate;
    duplicates += extra.is_duplicate ? 1 : 0;
    metrics.false_positives.push_back(extra);
  }
  for (std::size_t j = 0; j < truth.size(); ++j) {
    if (is_found[j] || !visibility[j].is_expected)
      continue;
    Unmatched miss;
    std::size_t nearest = 0;
    miss.id = truth[j].id;
    miss.visibility = visibility[j];
    findNearest(
        miss, truth[j].xy, map.size(), [&](std::size_t k) { return aligned * map[k].xy; }, nearest);
    if (!map.empty()) {
      miss.nearest_id = map[nearest].id;
      miss.estimate = map[nearest];
    }
    metrics.misses.push_back(miss);
  }

  metrics.all = summarize(metrics, [](const TrunkVisibility &) { return true; });
  metrics.recall = metrics.all.recall();
  if (metrics.confirmed > 0) {
    metrics.precision = static_cast<double>(metrics.matches.size()) / static_cast<double>(metrics.confirmed);
    metrics.duplicates = static_cast<double>(duplicates) / static_cast<double>(metrics.confirmed);
  }
  if (metrics.precision + metrics.recall == 0)
    metrics.f1 = 0;
  else // NaN where one of them is
    metrics.f1 = 2 * metrics.precision * metrics.recall / (metrics.precision + metrics.recall);
  metrics.by_range = binned(metrics, {0, 2, 4, 6, 8.001}, "m", &TrunkVisibility::min_range);
  metrics.by_parallax = binned(metrics, {0, 3, 10, 30, 60, 1e9}, "degrees", &TrunkVisibility::bearing_change);
  return metrics;
}
} // namespace bole
