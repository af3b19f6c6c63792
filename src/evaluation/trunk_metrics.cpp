// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluation/trunk_metrics.h"

#include "geometry/median.h"
#include "geometry/silhouette.h"

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

namespace
{
/// A trunk seen from above by one camera.
struct View
{
  double range = 0;
  double bearing = 0;    ///< in the world [rad]
  double half_width = 0; ///< asin(r/d) [rad]
  bool is_in_image = false;
};

double wrapped(double angle) { return std::remainder(angle, 2 * M_PI); }

View viewOf(const TruthTrunk &trunk, const Pose &wMc, const PinholeCamera &camera)
{
  View view;
  const Eigen::Vector2d to = trunk.xy - wMc.t.head<2>();
  view.range = to.norm();
  view.bearing = std::atan2(to.y(), to.x());
  if (trunk.radius <= 0 || view.range <= trunk.radius)
    return view;
  view.half_width = silhouetteHalfWidth(trunk.radius, view.range);
  view.is_in_image = true;
  for (const double side : {-1.0, 1.0}) {
    const double angle = view.bearing + side * view.half_width;
    const Eigen::Vector3d direction = wMc.R.transpose() * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    view.is_in_image = view.is_in_image && direction.z() > 1e-6 && camera.contains(camera.project(direction));
  }
  return view;
}

/// Share of the width of views[at] that nearer trunks cover.
double hiddenShare(const std::vector<View> &views, std::size_t at)
{
  const View &view = views[at];
  std::vector<std::pair<double, double>> covers;
  for (const View &other : views) {
    if (other.half_width <= 0 || other.range >= view.range)
      continue;
    const double middle = wrapped(other.bearing - view.bearing);
    const double from = std::max(middle - other.half_width, -view.half_width);
    const double to = std::min(middle + other.half_width, view.half_width);
    if (to > from)
      covers.emplace_back(from, to);
  }
  std::sort(covers.begin(), covers.end());
  double covered = 0, reached = -view.half_width;
  for (const auto &[from, to] : covers) {
    covered += std::max(0.0, to - std::max(from, reached));
    reached = std::max(reached, to);
  }
  return covered / (2 * view.half_width);
}
} // namespace

std::vector<TrunkVisibility> trunkVisibility(const std::vector<TruthTrunk> &trunks, const std::vector<Pose> &wMb,
                                             const Pose &bMc, const PinholeCamera &camera)
{
  constexpr double kMaxRange = 8;         // [m], horizontal, from the camera to the axis
  constexpr double kMaxHidden = 0.5;      // share of the trunk's width that nearer trunks may hide
  constexpr std::size_t kMinFrames = 8;   // in which all of this holds
  constexpr double kMinBearingChange = 3; // over those frames, in the world [degrees]
  struct Range
  {
    double first = 0, least = 0, most = 0;
  };
  std::vector<TrunkVisibility> result(trunks.size());
  std::vector<Range> bearings(trunks.size());
  std::vector<View> views(trunks.size());
  for (const Pose &pose : wMb) {
    const Pose wMc = pose * bMc;
    std::transform(trunks.begin(), trunks.end(), views.begin(),
                   [&](const TruthTrunk &trunk) { return viewOf(trunk, wMc, camera); });
    for (std::size_t i = 0; i < trunks.size(); ++i) {
      const View &view = views[i];
      if (!view.is_in_image || view.range > kMaxRange || hiddenShare(views, i) >= kMaxHidden)
        continue;
      TrunkVisibility &seen = result[i];
      Range &range = bearings[i];
      if (seen.frames++ == 0) {
        range.first = view.bearing;
        seen.min_range = view.range;
      }
      const double change = wrapped(view.bearing - range.first);
      range.least = std::min(range.least, change);
      range.most = std::max(range.most, change);
      seen.min_range = std::min(seen.min_range, view.range);
    }
  }
  for (std::size_t i = 0; i < trunks.size(); ++i) {
    result[i].bearing_change = (bearings[i].most - bearings[i].least) * 180 / M_PI;
    result[i].is_expected = result[i].frames >= kMinFrames && result[i].bearing_change >= kMinBearingChange;
  }
  return result;
}

namespace
{
/// Least-cost assignment of every row of \p cost, rows <= columns, by shortest augmenting paths.
std::vector<int> assignRows(const Eigen::MatrixXd &cost)
{
  const Eigen::Index rows = cost.rows(), columns = cost.cols();
  const Eigen::Index none = columns; // a column that does not exist: where each search starts
  Eigen::VectorXd row_price = Eigen::VectorXd::Zero(rows), column_price = Eigen::VectorXd::Zero(columns + 1);
  std::vector<Eigen::Index> row_of(static_cast<std::size_t>(columns) + 1, -1);
  for (Eigen::Index row = 0; row < rows; ++row) {
    Eigen::VectorXd slack = Eigen::VectorXd::Constant(columns, std::numeric_limits<double>::infinity());
    std::vector<Eigen::Index> came_from(static_cast<std::size_t>(columns), none);
    std::vector<bool> is_done(static_cast<std::size_t>(columns) + 1, false);
    Eigen::Index at = none;
    row_of[static_cast<std::size_t>(none)] = row;
    while (row_of[static_cast<std::size_t>(at)] >= 0) {
      is_done[static_cast<std::size_t>(at)] = true;
      const Eigen::Index r = row_of[static_cast<std::size_t>(at)];
      double least = std::numeric_limits<double>::infinity();
      Eigen::Index nearest = none;
      for (Eigen::Index c = 0; c < columns; ++c) {
        if (is_done[static_cast<std::size_t>(c)])
          continue;
        const double reduced = cost(r, c) - row_price[r] - column_price[c];
        if (reduced < slack[c]) {
          slack[c] = reduced;
          came_from[static_cast<std::size_t>(c)] = at;
        }
        if (slack[c] < least) {
          least = slack[c];
          nearest = c;
        }
      }
      for (Eigen::Index c = 0; c <= columns; ++c)
        if (is_done[static_cast<std::size_t>(c)]) {
          row_price[row_of[static_cast<std::size_t>(c)]] += least;
          column_price[c] -= least;
        }
        else if (c < columns)
          slack[c] -= least;
      at = nearest;
    }
    while (at != none) {
      const Eigen::Index before = came_from[static_cast<std::size_t>(at)];
      row_of[static_cast<std::size_t>(at)] = row_of[static_cast<std::size_t>(before)];
      at = before;
    }
  }
  std::vector<int> column_of(static_cast<std::size_t>(rows), -1);
  for (Eigen::Index c = 0; c < columns; ++c)
    if (row_of[static_cast<std::size_t>(c)] >= 0)
      column_of[static_cast<std::size_t>(row_of[static_cast<std::size_t>(c)])] = static_cast<int>(c);
  return column_of;
}
} // namespace

std::vector<int> assign(const Eigen::MatrixXd &cost, double gate)
{
  if (cost.rows() == 0 || cost.cols() == 0)
    return std::vector<int>(static_cast<std::size_t>(cost.rows()), -1);
  // A pair beyond the gate costs more than all pairs within it together, so it is never preferred;
  // spare columns let every row stay alone at that price.
  const double alone = (gate + 1) * static_cast<double>(cost.rows() + 1);
  Eigen::MatrixXd padded = Eigen::MatrixXd::Constant(cost.rows(), cost.cols() + cost.rows(), alone);
  padded.leftCols(cost.cols()) = (cost.array() <= gate).select(cost.array(), 4 * alone).matrix();
  std::vector<int> column_of = assignRows(padded);
  for (int &column : column_of)
    if (column >= cost.cols())
      column = -1;
  return column_of;
}
} // namespace bole
