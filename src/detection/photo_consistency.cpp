// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/photo_consistency.h"

#include "geometry/median.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace bole
{
using Eigen::Vector2d;

namespace
{
constexpr std::array<double, kTriedRanges> kScales = {0.5, 0.65, 0.8, 0.9, 1, 1.11, 1.25, 1.5, 2, 3, 1000};
constexpr std::size_t kOwn = 4, kBeyond = 6, kBackground = 8;
constexpr std::size_t kPartners = 3; // a view is compared with

/// Parallax of the trunk against what stands twice as far [px of a focal length of 200 px, as an angle]: enough to
/// tell, not so much that the bark has turned.
constexpr double kLeastParallax = 0.015, kMostParallax = 0.08, kBestParallax = 0.035, kWeakParallax = 0.006;

struct Seen
{
  std::size_t view = 0;
  TrunkInColumnView at;
};

constexpr double kBin = 0.5;                         // [px] of a place across where a trunk's ends are looked for
constexpr std::size_t kMostInside = 12, kBeside = 4; // columns inside a trunk, beside each of its borders

/// What the columns of ConsistencyCurves count for, in its order.
constexpr std::size_t kInside = 0, kBesideLeft = 1, kBesideRight = 2, kInsideLeft = 3, kInsideRight = 4;

/// A column of a view that is compared.
struct Column
{
  double angle = 0, range = 0; ///< from the heading [rad], of what it shows if the trunk is there [m]
  std::size_t kind = kInside;  ///< what it counts for
  bool is_beside = false;      ///< outside of the borders that are thought
  std::size_t also = kInside;  ///< for what else, if for anything
};

std::vector<Column> columnsInside(const TrunkInColumnView &at, double radius, double px)
{
  std::vector<Column> columns;
  columns.reserve(kMostInside + 2 * kBeside);
  const double half = std::max(at.half_angle - px, 0.3 * at.half_angle);
  const auto inside = static_cast<std::size_t>(std::clamp(2 * half / px, 3.0, double(kMostInside)));
  for (std::size_t i = 0; i < inside; ++i) {
    const double offset = half * (2.0 * static_cast<double>(i) / static_cast<double>(inside - 1) - 1);
    const double across = at.range * std::sin(offset);
    columns.push_back({at.bearing + offset,
                       at.range * std::cos(offset) - std::sqrt(std::max(radius * radius - across * across, 0.0))});
    if (std::abs(offset) > 0.5 * half)
      columns.back().also = offset > 0 ? kInsideLeft : kInsideRight;
  }
  return columns;
}

/// The columns to compare: inside the trunk and beside its borders.
std::vector<Column> columnsOf(const TrunkInColumnView &at, double radius, double px)
{
  std::vector<Column> columns = columnsInside(at, radius, px);
  const double strip = std::max(2.5 * px, std::min(0.4 * at.half_angle, 6 * px));
  for (const std::size_t kind : {kBesideLeft, kBesideRight})
    for (std::size_t i = 0; i < kBeside; ++i) {
      const double offset = at.half_angle + 1.5 * px + strip * static_cast<double>(i) / (kBeside - 1);
      columns.push_back({at.bearing + (kind == kBesideLeft ? offset : -offset), at.range, kind, true});
    }
  return columns;
}

/// The views that stand apart by the right parallax, the best first.
std::vector<std::size_t> stereoPartners(const Seen &seen, const std::vector<Seen> &all,
                                        const std::vector<ColumnView> &views)
{
  const ColumnView &view = views[seen.view];
  const double c = std::cos(seen.at.bearing), s = std::sin(seen.at.bearing);
  const Vector2d toward = c * view.forward + s * view.left;
  std::vector<std::pair<double, std::size_t>> good;
  good.reserve(all.size());
  std::pair<double, std::size_t> widest{0, 0};
  for (const Seen &other : all) {
    const Vector2d base = views[other.view].position - view.position;
    const double parallax = 0.5 * std::abs(base.x() * toward.y() - base.y() * toward.x()) / seen.at.range;
    if (parallax >= kLeastParallax && parallax <= kMostParallax)
      good.emplace_back(std::abs(parallax - kBestParallax), other.view);
    widest = std::max(widest, {parallax, other.view});
  }
  if (good.empty() && widest.first >= kWeakParallax)
    return {widest.second};
  const std::size_t n = std::min(good.size(), kPartners);
  std::partial_sort(good.begin(), good.begin() + static_cast<long>(n), good.end());
  std::vector<std::size_t> partners;
  partners.reserve(n);
  for (std::size_t i = 0; i < n; ++i)
    partners.push_back(good[i].second);
  return partners;
}

double across(const Vector2d &direction, const Vector2d &a) { return direction.x() * a.y() - direction.y() * a.x(); }

/// What a trunk covers in a view [tan of the bearing]; nothing where it is not in sight.
std::pair<double, double> coveredBy(const Trunk &trunk, const ColumnView &view, double margin_px)
{
  const auto at = locate(trunk, view, std::numeric_limits<double>::infinity());
  if (!at)
    return {0, 0};
  const double half = at->half_angle + margin_px * view.image->step;
  return {std::tan(at->bearing - half), std::tan(at->bearing + half)};
}

/// How \p view sees what stands at a range along \p direction from \p from and leans by \p lean [tan].
CarriedColumn carriedTo(const ColumnView &view, const Vector2d &from, const Vector2d &direction, const Vector2d &lean)
{
  const Vector2d base = from - view.position;
  const auto number = [](double value) { return static_cast<float>(value); };
  return {number(base.dot(view.forward)),
          number(direction.dot(view.forward)),
          number(base.dot(view.left)),
          number(direction.dot(view.left)),
          number(across(base, lean)),
          number(across(direction, lean)),
          0,
          0,
          std::numeric_limits<float>::max()};
}

OtherColumns numbersOf(const ColumnImage &image)
{
  OtherColumns columns{};
  columns.q_first = static_cast<float>(image.q_first);
  columns.by_step = static_cast<float>(1 / image.step);
  columns.count = static_cast<int>(image.columns());
  for (std::size_t b = 0; b < kLevelBands; ++b) {
    columns.value[b] = image.value[b].data();
    columns.slope[b] = image.slope[b].data();
    columns.elevation[b] = static_cast<float>(image.elevation[b]);
  }
  return columns;
}

/// Compares \p columns of the view \p seen with its partners among \p all, at the ranges \p scales over theirs.
/// \p add: takes the kind of a column, which of the ranges, the difference.
template <std::size_t Tried, typename Add>
void compare(const Trunk &trunk, const Seen &seen, const std::vector<Column> &columns, const std::vector<Seen> &all,
             const std::vector<ColumnView> &views, const std::array<double, Tried> &scales, const Add &add,
             double margin_px = 0)
{
  constexpr double kGround = -0.35; // tan of the elevation below which the ground stands beside a trunk, as near as it
  constexpr double kUnit = 0.25;    // of the contrast of the image: how much one place differs between two frames
  constexpr double kLeast = 0.008;  // [full scale] noise of the camera
  constexpr double kHidden = 1.05;  // over the range of the trunk: behind it
  struct Partner
  {
    const ColumnView *view;
    std::pair<double, double> covered;
    OtherColumns columns;
    float by_value;
  };
  const ColumnView &view = views[seen.view];
  std::vector<Partner> partners;
  partners.reserve(kPartners);
  for (const std::size_t p : stereoPartners(seen, all, views)) {
    const double unit = std::max(kUnit * 0.5 * (view.image->contrast + views[p].image->contrast), kLeast);
    partners.push_back(
        {&views[p], coveredBy(trunk, views[p], margin_px), numbersOf(*views[p].image), static_cast<float>(1 / unit)});
  }
  constexpr std::size_t kTogether = 8, kPadded = (Tried + kTogether - 1) / kTogether * kTogether;
  std::array<float, kPadded> ranges{}, differences{};
  for (const Column &one : columns) {
    const double c = std::cos(one.angle), s = std::sin(one.angle);
    const Vector2d direction = c * view.forward + s * view.left;
    LevelColumn column = view.image->at(s / c, across(direction, trunk.lean));
    if (one.is_beside)
      for (std::size_t b = 0; b < kLevelBands; ++b)
        if (view.image->elevation[b] <= kGround)
          column.value[b] = std::numeric_limits<float>::quiet_NaN();
    for (std::size_t i = 0; i < Tried; ++i)
      ranges[i] = static_cast<float>(one.range * scales[i]);
    for (const Partner &other : partners) {
      CarriedColumn carried = carriedTo(*other.view, view.position, direction, trunk.lean);
      if (one.is_beside) { // what stands behind the trunk there is hidden by it
        carried.hidden_first = static_cast<float>(other.covered.first);
        carried.hidden_last = static_cast<float>(other.covered.second);
        carried.hidden_beyond = static_cast<float>(one.range * kHidden);
      }
      differencesAtRanges(column, carried, other.columns, other.by_value, 2 * other.by_value, ranges.data(),
                          static_cast<int>(kPadded), differences.data());
      for (std::size_t i = 0; i < Tried; ++i)
        if (const double d = static_cast<double>(differences[i]); d >= 0) {
          add(one.kind, i, d);
          if (one.also != kInside)
            add(one.also, i, d);
        }
    }
  }
}

/// Compares one view of \p trunk with its stereo partners among \p all; none where no partner shows the same columns.
std::optional<ConsistencyCurves> curvesOf(const Trunk &trunk, const Seen &seen, const std::vector<Seen> &all,
                                          const std::vector<ColumnView> &views)
{
  ConsistencyCurves here;
  compare(trunk, seen, columnsOf(seen.at, trunk.radius(), views[seen.view].image->step), all, views, kScales,
          [&here](std::size_t kind, std::size_t k, double d) { here.add(kind, k, d); });
  return here.count[kInside][kOwn] > 0 ? std::optional(here) : std::nullopt;
}

std::vector<Seen> locateAll(const Trunk &trunk, const std::vector<ColumnView> &views, double farthest)
{
  std::vector<Seen> all;
  all.reserve(views.size());
  for (std::size_t i = 0; i < views.size(); ++i)
    if (const auto at = locate(trunk, views[i], farthest))
      all.push_back({i, *at});
  return all;
}

/// At most kViews of the views, evenly spread over the flight.
std::vector<Seen> evenSubset(const std::vector<Seen> &all)
{
  constexpr std::size_t kViews = 24;
  if (all.size() <= kViews)
    return all;
  std::vector<Seen> some;
  some.reserve(kViews);
  for (std::size_t i = 0; i < kViews; ++i)
    some.push_back(all[i * (all.size() - 1) / (kViews - 1)]);
  return some;
}
} // namespace

void ConsistencyCurves::add(std::size_t kind, std::size_t range, double value)
{
  sum[kind][range] += value;
  ++count[kind][range];
}

void ConsistencyCurves::add(const ConsistencyCurves &view)
{
  for (std::size_t kind = 0; kind < sum.size(); ++kind)
    for (std::size_t k = 0; k < kTriedRanges; ++k)
      if (view.count[kind][k] > 0)
        add(kind, k, view.mean(kind, k));
  ++views;
}

void ConsistencyCurves::fade(double share)
{
  for (std::size_t kind = 0; kind < sum.size(); ++kind)
    for (std::size_t k = 0; k < kTriedRanges; ++k) {
      sum[kind][k] *= share;
      count[kind][k] *= share;
    }
}

double ConsistencyCurves::mean(std::size_t kind, std::size_t range) const
{
  return count[kind][range] > 0 ? sum[kind][range] / count[kind][range] : std::numeric_limits<double>::infinity();
}

double ConsistencyCurves::least(std::size_t kind, std::size_t first, std::size_t end) const
{
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t s = first; s < end; ++s)
    best = std::min(best, mean(kind, s));
  return best;
}

ColumnView::ColumnView(const ColumnImage &level, const Pose &wMc, double time)
    : image(&level), position(wMc.t.head<2>()), z(wMc.t.z()), time_s(time)
{
  forward = (wMc.R * level.cRl).col(0).head<2>().normalized();
  left = {-forward.y(), forward.x()};
}

std::optional<TrunkInColumnView> locate(const Trunk &trunk, const ColumnView &view, double farthest)
{
  constexpr double kAhead = 0.3, kNotInside = 0.3, kSide = 0.02; // [m], [m] from the bark, [rad]
  const Vector2d w = trunk.axisAt(view.z).head<2>() - view.position;
  const double ahead = w.dot(view.forward), range = w.norm(), radius = trunk.radius();
  if (ahead < kAhead || range < radius + kNotInside || range > farthest)
    return std::nullopt;
  TrunkInColumnView at{std::atan2(w.dot(view.left), ahead), std::asin(radius / range), range};
  if (std::abs(at.bearing) + at.half_angle > std::atan(-view.image->q_first) - kSide)
    return std::nullopt;
  return at;
}

std::optional<ConsistencyCurves> consistencyOfView(const Trunk &trunk, std::size_t which,
                                                   const std::vector<ColumnView> &views, double farthest)
{
  const auto at = locate(trunk, views[which], farthest);
  if (!at)
    return std::nullopt;
  const auto here = curvesOf(trunk, {which, *at}, locateAll(trunk, views, farthest), views);
  if (!here)
    return std::nullopt;
  ConsistencyCurves curves;
  curves.add(*here);
  return curves;
}

std::optional<PhotoConsistency> photoConsistency(const Trunk &trunk, const std::vector<ColumnView> &views,
                                                 double farthest)
{
  const std::vector<Seen> all = locateAll(trunk, views, farthest);
  ConsistencyCurves curves;
  for (const Seen &seen : evenSubset(all))
    if (const auto here = curvesOf(trunk, seen, all, views))
      curves.add(*here);
  return consistencyOf(curves);
}

double freeBeside(const Trunk &trunk, const std::vector<ColumnView> &views, double farthest)
{
  constexpr std::array<double, 4> kScalesBeside = {1, 2, 3, 1000};
  constexpr double kOff_px = 3, kNarrowest_px = 6, kWidest_px = 16; // of a strip, else as wide as the trunk
  constexpr std::size_t kColumns = 6;
  const std::vector<Seen> all = locateAll(trunk, views, farthest);
  ConsistencyCurves curves;
  for (const Seen &seen : evenSubset(all)) {
    const double px = views[seen.view].image->step, half = seen.at.half_angle;
    const double width = std::clamp(2 * half, kNarrowest_px * px, kWidest_px * px);
    std::vector<Column> columns;
    for (std::size_t i = 0; i < kColumns; ++i) {
      const double off = half + kOff_px * px + width * static_cast<double>(i) / (kColumns - 1);
      columns.push_back({seen.at.bearing + off, seen.at.range, kBesideLeft, true});
      columns.push_back({seen.at.bearing - off, seen.at.range, kBesideRight, true});
    }
    ConsistencyCurves here;
    compare(
        trunk, seen, columns, all, views, kScalesBeside,
        [&here](std::size_t kind, std::size_t k, double d) { here.add(kind, k, d); }, kOff_px);
    curves.add(here);
  }
  double most = -std::numeric_limits<double>::infinity();
  for (const std::size_t side : {kBesideLeft, kBesideRight})
    if (const double by = curves.mean(side, 0) - curves.least(side, 1, kScalesBeside.size()); std::isfinite(by))
      most = std::max(most, by);
  return std::isfinite(most) ? most : 0;
}

std::optional<PhotoConsistency> consistencyOf(const ConsistencyCurves &curves)
{
  constexpr int kLeastViews = 3;
  if (curves.views < kLeastViews)
    return std::nullopt;
  PhotoConsistency evidence;
  evidence.views = curves.views;
  const auto from = [&](std::size_t kind, std::size_t first, std::size_t end, double own) {
    const double best = curves.least(kind, first, end);
    return std::isfinite(best) ? best - own : 0;
  };
  evidence.own = curves.mean(kInside, kOwn);
  evidence.nearer = from(kInside, 0, 3, evidence.own);
  evidence.beyond = from(kInside, kBeyond, kBackground, evidence.own);
  evidence.background = from(kInside, kBackground, kScales.size(), evidence.own);
  evidence.is_best_at_own = curves.least(kInside, kOwn - 1, kOwn + 2) <= curves.least(kInside, 0, kScales.size());
  const auto beside = [&](std::size_t kind) {
    return std::isfinite(curves.mean(kind, kOwn)) ? -from(kind, kBeyond + 1, kScales.size(), curves.mean(kind, kOwn))
                                                  : 0;
  };
  evidence.left = beside(kBesideLeft);
  evidence.right = beside(kBesideRight);
  evidence.inside_left = beside(kInsideLeft);
  evidence.inside_right = beside(kInsideRight);
  return evidence;
}

namespace
{
/// Where the columns inside a trunk differ least.
struct LeastDifference
{
  double log_scale = 0; ///< of the range, over that where the trunk is thought to stand
  double difference = 0;
};

/// \p on_bark: how far what the columns show stands out from the plane of the axis, 1 as the bark does.
std::optional<LeastDifference> leastDifference(double on_bark, const Trunk &trunk, const std::vector<Seen> &all,
                                               const std::vector<ColumnView> &views)
{
  constexpr std::size_t kTried = 32;
  constexpr double kStep = 0.02; // of the logarithm of the range
  constexpr int kLeastViews = 3;
  std::array<double, kTried> scales, sum{}, seen{};
  for (std::size_t k = 0; k < kTried; ++k)
    scales[k] = std::exp(kStep * (static_cast<double>(k) - 0.5 * (kTried - 1)));
  for (const Seen &one : evenSubset(all)) {
    std::vector<Column> columns = columnsInside(one.at, trunk.radius(), views[one.view].image->step);
    for (Column &column : columns) {
      const double axis = one.at.range * std::cos(column.angle - one.at.bearing);
      column.range = axis + on_bark * (column.range - axis);
    }
    std::array<double, kTried> here{}, count{};
    compare(trunk, one, columns, all, views, scales, [&](std::size_t kind, std::size_t k, double d) {
      here[k] += kind == kInside ? d : 0;
      count[k] += kind == kInside;
    });
    for (std::size_t k = 0; k < kTried; ++k)
      if (count[k] > 0) { // each view counts as much
        sum[k] += here[k] / count[k];
        ++seen[k];
      }
  }
  for (std::size_t k = 0; k < kTried; ++k)
    sum[k] = seen[k] >= kLeastViews ? sum[k] / seen[k] : std::numeric_limits<double>::infinity();
  const auto best = static_cast<std::size_t>(std::min_element(sum.begin(), sum.end()) - sum.begin());
  if (best == 0 || best + 1 == kTried || !std::isfinite(sum[best - 1] + sum[best + 1]))
    return std::nullopt;
  return LeastDifference{std::log(scales[best]) + kStep * peakOffset(-sum[best - 1], -sum[best], -sum[best + 1]),
                         sum[best]};
}
} // namespace

std::optional<double> rangeByTexture(const Trunk &trunk, const std::vector<ColumnView> &views, double farthest)
{
  constexpr double kSure = 0.01; // a mean difference that speaks for the one or the other
  const std::vector<Seen> all = locateAll(trunk, views, farthest);
  const auto bark = leastDifference(1, trunk, all, views), shade = leastDifference(0, trunk, all, views);
  if (!bark || !shade)
    return bark ? std::optional(bark->log_scale) : std::nullopt;
  const double by_bark = 1 / (1 + std::exp((bark->difference - shade->difference) / kSure));
  return by_bark * bark->log_scale + (1 - by_bark) * shade->log_scale;
}

namespace
{
/// depthBorders(), looked for up to \p reach bins on either side of the axis. \p px: DepthBorders::px.
std::optional<DepthBorders> depthBordersWithin(int reach, double px, const Trunk &trunk, const std::vector<Seen> &all,
                                               const std::vector<ColumnView> &views)
{
  // logarithms of the ratio of both differences, the trunk's over the background's
  constexpr double kThere = -0.5, kSurely = -0.3, kLikely = -0.15;
  constexpr double kAlike = 0.1; // difference of two columns that show the same
  constexpr std::array<double, 7> kHereAndBehind = {kScales[kOwn - 1], kScales[kOwn], kScales[kOwn + 1], kScales[7],
                                                    kScales[8],        kScales[9],    kScales[10]};
  constexpr std::size_t kHere = 3; // of them the first
  const double radius = trunk.radius(), bin = kBin * px;
  std::vector<ConsistencyCurves> places(static_cast<std::size_t>(2 * reach + 1)); // across, from right to left
  std::vector<Column> columns(places.size());
  for (const Seen &seen : evenSubset(all)) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const double across = bin * (static_cast<double>(i) - reach);
      const double depth = std::sqrt(std::max(radius * radius - across * across, 0.0));
      columns[i] = {seen.at.bearing + std::atan(across / seen.at.range), seen.at.range - depth, i,
                    std::abs(across) > radius};
    }
    compare(trunk, seen, columns, all, views, kHereAndBehind,
            [&places](std::size_t i, std::size_t k, double d) { places[i].add(0, k, d); });
  }
  const auto ratioAt = [&](int across) { // infinite or NaN where it is not known
    const ConsistencyCurves &place = places[static_cast<std::size_t>(across + reach)];
    return std::log((place.least(0, 0, kHere) + kAlike) / (place.least(0, kHere, kHereAndBehind.size()) + kAlike));
  };
  const int within = static_cast<int>(0.7 * radius / bin);
  int middle = 0;
  for (int i = -within; i <= within; ++i)
    if (std::isfinite(ratioAt(i)) && !(ratioAt(i) >= ratioAt(middle)))
      middle = i;
  if (!(ratioAt(middle) <= kThere))
    return std::nullopt;
  const auto risesTo = [&](double ratio, int side) -> std::optional<double> {
    for (int i = middle; std::abs(i) < reach; i += side) {
      const double here = ratioAt(i), next = ratioAt(i + side);
      if (!std::isfinite(next))
        return std::nullopt;
      if (next >= ratio)
        return bin * (side * i + (ratio - here) / (next - here));
    }
    return std::nullopt;
  };
  DepthBorders borders;
  borders.px = px;
  borders.least = {risesTo(kSurely, 1), risesTo(kSurely, -1)};
  borders.likely = {risesTo(kLikely, 1), risesTo(kLikely, -1)};
  return borders;
}
} // namespace

std::optional<DepthBorders> depthBorders(const Trunk &trunk, const std::vector<ColumnView> &views, double farthest,
                                         double thickest)
{
  constexpr double kNear = 6, kFar = 8; // [px] outside of the borders
  constexpr std::size_t kLeastViews = 6;
  const std::vector<Seen> all = locateAll(trunk, views, farthest);
  if (all.size() < kLeastViews)
    return std::nullopt;
  std::vector<double> pixels;
  for (const Seen &seen : all)
    pixels.push_back(views[seen.view].image->step * seen.at.range);
  const double px = medianOf(pixels), radius = trunk.radius();
  const auto within = [&](double metres) {
    return depthBordersWithin(static_cast<int>(std::ceil(metres / (kBin * px))), px, trunk, all, views);
  };
  const auto near = within(radius + kNear * px); // a far place costs as much, and is seldom asked
  if (!near || (near->likely[0] && near->likely[1]))
    return near;
  return within(std::max(4 * radius, 2 * thickest) + kFar * px);
}
} // namespace bole
