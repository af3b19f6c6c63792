// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/trunk_evidence.h"
#include "geometry/horizontal_view.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace bole
{
namespace
{
struct Tangents
{
  double low, high;
};

/// Least cost of a column between two steps; negative where nothing was seen.
double leastCost(const ColumnDepth &depth, int column, int from, int to, const Tangents &tan)
{
  double least = -1;
  for (int s = from; s <= to; ++s) {
    const double cost = depth.cost(column, s, tan.low, tan.high);
    if (cost >= 0 && (least < 0 || cost < least))
      least = cost;
  }
  return least;
}

struct Means
{
  double far = 0, near = 0;
  int far_n = 0, near_n = 0;
};

/// How columns between \p from and \p to agree at the step \p own against farther and nearer ones.
Means compare(const EvidenceView &view, int from, int to, double own, const DepthSweep &sweep, const Tangents &tan)
{
  Means means;
  const int at = static_cast<int>(std::lround(own)), far = static_cast<int>(0.75 * own) - 1,
            near = static_cast<int>(std::ceil(1.33 * own)) + 1;
  for (int c = from; c <= to; ++c) {
    const double here = leastCost(view.depth, c, at - 1, at + 1, tan);
    if (here < 0)
      continue;
    const double beyond = leastCost(view.depth, c, 0, far, tan),
                 before = leastCost(view.depth, c, near, sweep.steps - 1, tan);
    if (beyond >= 0) {
      means.far += beyond - here;
      ++means.far_n;
    }
    if (before >= 0) {
      means.near += before - here;
      ++means.near_n;
    }
  }
  means.far /= std::max(1, means.far_n);
  means.near /= std::max(1, means.near_n);
  return means;
}

/// Mean step of brightness to the left between two rows at a column.
double stepAt(const LevelImage &image, int column, int begin, int end)
{
  const float *a = image.grey(column - 1), *b = image.grey(column + 1);
  const LevelImage::Span s = image.span(column - 1), t = image.span(column + 1);
  begin = std::max<int>({begin, s.begin, t.begin});
  end = std::min<int>({end, s.end, t.end});
  double sum = 0;
  for (int r = begin; r < end; ++r)
    sum += static_cast<double>(b[r] - a[r]);
  return end > begin ? 0.5 * sum / (end - begin) : 0;
}

struct Running
{
  double sum = 0, square = 0;
  int n = 0;
  void add(double x)
  {
    sum += x;
    square += x * x;
    ++n;
  }
  double mean() const { return n ? sum / n : 0; }
  double constant() const { return n ? mean() * mean() / (square / n + 1e-9) : 0; }
};
} // namespace

std::vector<EvidenceView> evidenceViews(const std::vector<LevelImage> &images, double baseline, const DepthSweep &sweep)
{
  std::vector<EvidenceView> views;
  constexpr long kEvery = 3; // the next ones show the same
  const auto count = static_cast<long>(images.size());
  for (long i = 0; i < count; i += kEvery) {
    const LevelImage &image = images[static_cast<std::size_t>(i)];
    std::vector<const LevelImage *> beside;
    for (const long direction : {-1L, 1L})
      for (long j = i + direction; j >= 0 && j < count; j += direction) {
        const LevelImage &other = images[static_cast<std::size_t>(j)];
        if ((other.wMc().t - image.wMc().t).head<2>().norm() < baseline)
          continue;
        beside.push_back(&other);
        break;
      }
    views.push_back({image, ColumnDepth(image, beside, sweep)});
  }
  return views;
}

TrunkEvidence evidenceOf(const Trunk &trunk, const std::vector<EvidenceView> &views, const DepthSweep &sweep,
                         const EvidencePart &part)
{
  TrunkEvidence evidence;
  Running inside, covered, left, right, left_step, right_step;
  double first = 0, low = 0, high = 0;
  for (const EvidenceView &view : views) {
    const LevelImage &image = view.image;
    const HorizontalView seen = horizontalView(image.wMc(), trunk);
    if (seen.range > part.range_max || seen.range < 1.5 * trunk.radius() + 0.2)
      continue;
    const double c_left = image.columnOf(seen.bearing + seen.half_angle),
                 c_right = image.columnOf(seen.bearing - seen.half_angle);
    if (c_right < 5 || c_left > image.columns() - 6 || c_left < c_right)
      continue;
    const double above = image.wMc().t.z() - part.ground_z;
    const Tangents tan{(part.low - above) / seen.range, (part.high - above) / seen.range};
    const LevelImage::Span span = image.span(static_cast<int>(0.5 * (c_left + c_right)));
    const LevelGrid &grid = image.grid();
    const int begin = std::max<int>(span.begin, static_cast<int>(std::ceil(grid.rowOf(tan.low)))),
              end = std::min<int>(span.end, static_cast<int>(std::floor(grid.rowOf(tan.high))) + 1);
    if (end - begin < 6)
      continue;
    if (evidence.views++ == 0)
      first = seen.bearing;
    const double turned = std::remainder(seen.bearing - first, 2 * M_PI);
    low = std::min(low, turned);
    high = std::max(high, turned);
    evidence.width_px += c_left - c_right;
    evidence.range += seen.range;

    const double own = sweep.stepOf(seen.range - 0.6 * trunk.radius());
    int in_right = static_cast<int>(std::ceil(c_right + 0.7)), in_left = static_cast<int>(std::floor(c_left - 0.7));
    if (in_left < in_right)
      in_left = in_right = static_cast<int>(std::lround(0.5 * (c_left + c_right)));
    const Means in = compare(view, in_right, in_left, own, sweep, tan);
    if (in.far_n)
      inside.add(in.far);
    if (in.near_n)
      covered.add(in.near);
    const int out_left = static_cast<int>(std::ceil(c_left + 1)), out_right = static_cast<int>(std::floor(c_right - 1));
    const double edge = sweep.stepOf(seen.range);
    const Means l = compare(view, out_left, out_left + 2, edge, sweep, tan),
                r = compare(view, out_right - 2, out_right, edge, sweep, tan);
    if (l.far_n)
      left.add(-l.far);
    if (r.far_n)
      right.add(-r.far);

    double usual = 0;
    for (int c = 2; c + 2 < image.columns(); c += 3)
      usual += std::abs(stepAt(image, c, begin, end));
    usual /= (image.columns() - 4) / 3.0;
    const auto strongest = [&](double column) {
      double best = 0;
      const int c = static_cast<int>(std::lround(column));
      for (int k = c - 1; k <= c + 1; ++k) {
        const double step = stepAt(image, k, begin, end);
        if (std::abs(step) > std::abs(best))
          best = step;
      }
      return std::clamp(best / (usual + 0.3), -4.0, 4.0);
    };
    left_step.add(strongest(c_left));
    right_step.add(strongest(c_right));
  }
  if (evidence.views == 0)
    return evidence;
  evidence.inside = inside.mean();
  evidence.covered = covered.mean();
  evidence.left = left.mean();
  evidence.right = right.mean();
  evidence.border = std::min(std::abs(left_step.mean()), std::abs(right_step.mean()));
  evidence.constant = std::min(left_step.constant(), right_step.constant());
  evidence.width_px /= evidence.views;
  evidence.range /= evidence.views;
  evidence.parallax = high - low;
  return evidence;
}

const char *const kEvidenceTermNames[] = {"inside", "covered",  "weaker side", "stronger side", "border", "constant",
                                          "views",  "parallax", "width",       "range",         "1"};

EvidenceTerms termsOf(const TrunkEvidence &e)
{
  constexpr double kMostSide = 0.15; // more of a difference says no more
  const auto side = [=](double difference) { return 10 * std::clamp(difference, -kMostSide, kMostSide); };
  EvidenceTerms terms;
  terms << 10 * e.inside, 10 * e.covered, side(std::min(e.left, e.right)), side(std::max(e.left, e.right)),
      std::log(e.border + 0.1), 3 * e.constant, std::log(e.views + 1.0), std::log(e.parallax + 0.02),
      std::log(e.width_px + 1), std::log(e.range + 0.5), 1;
  return terms;
}

double logOdds(const TrunkEvidence &evidence)
{
  EvidenceTerms weights; // bole fit-odds, seeds 300 to 315
  weights << 0.94, 0.46, 0.15, 0.59, 0.36, 0.79, 0.50, 0.37, -0.81, -2.95, 3.45;
  return weights.dot(termsOf(evidence));
}
} // namespace bole
