// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluation/trunk_metrics.h"

#include "geometry/silhouette.h"

#include <algorithm>
#include <cmath>

namespace bole
{
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
} // namespace bole
