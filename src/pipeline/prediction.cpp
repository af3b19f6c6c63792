// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/prediction.h"

#include "geometry/silhouette.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
/// Variance that misses add to the bearing of a trunk: the error of its prediction grows from frame to frame [rad^2].
double missedVariance(int misses, double fx, const StageOptions &options)
{
  const double sigma_px = std::min(options.flow.search_px * misses, options.tracking.scan_max_px / 3);
  return std::pow(sigma_px / fx, 2);
}
} // namespace

HiddenBorders hiddenBorders(const Trunk &trunk, int id, const TrunkMap &map, const Viewpoint &view)
{
  constexpr double kNearer = 0.2;  // what hides stands nearer by this [m]
  constexpr double kMargin_px = 2; // borders this near to a nearer trunk are mistaken for its own
  const HorizontalView seen = horizontalView(view.wMc, trunk);
  HiddenBorders hidden;
  for (const std::size_t i : map.active()) {
    const MapTrunk &other = map.trunks()[i];
    if (other.id == id || other.status != TrunkStatus::confirmed)
      continue;
    const HorizontalView nearer = horizontalView(view.wMc, other.trunk);
    if (nearer.range > seen.range - kNearer)
      continue;
    const double half_angle = nearer.half_angle + kMargin_px / view.camera.fx;
    const double apart = std::remainder(seen.bearing - nearer.bearing, 2 * M_PI);
    hidden.left |= std::abs(apart + seen.half_angle) < half_angle;
    hidden.right |= std::abs(apart - seen.half_angle) < half_angle;
  }
  return hidden;
}

ElevationRange elevationOf(const RelativeTrunk &relative, const Trunk &trunk, const Viewpoint &view,
                           const StageOptions &options)
{
  if (!view.has_ranges)
    return kUnrangedPart;
  if (!view.ground)
    return options.detection.profile.range;
  const double d = trunk.radius() / relative.ratio();
  const double tangent = std::sqrt(std::max(d * d - trunk.radius() * trunk.radius(), 0.01));
  const double above = view.wMc.t.z() - view.ground->heightAt(trunk.xy);
  return {(options.flow.trunk_low - above) / tangent, (options.flow.trunk_high - above) / tangent};
}

ElevationRange textureRange(const RelativeTrunk &relative, const Trunk &trunk, const Viewpoint &view,
                            const StageOptions &options)
{
  ElevationRange part = elevationOf(relative, trunk, view, options);
  part.high = std::max(part.high, options.detection.profile.range.high);
  return part;
}

std::vector<PredictedTrunk> predictTrunks(const TrunkMap &map, const Smoother &smoother, const Viewpoint &view,
                                          const StageOptions &options)
{
  std::vector<PredictedTrunk> predicted;
  for (const std::size_t i : map.active()) {
    const MapTrunk &trunk = map.trunks()[i];
    PredictedTrunk prediction;
    prediction.id = trunk.id;
    prediction.smoother_id = trunk.smoother_id;
    prediction.range = horizontalView(view.wMc, trunk.trunk).range;
    if (view.has_ranges && prediction.range > options.flow.track_range)
      continue;
    TrackingPrediction &tracking = prediction.tracking;
    tracking.relative = smoother.predictedRelative(trunk.smoother_id);
    if (!tracking.relative.isFinite() || tracking.relative.cRt(2, 0) <= 0) // behind the camera
      continue;
    prediction.missed_variance = missedVariance(trunk.misses_in_a_row, view.camera.fx, options);
    tracking.covariance = smoother.relativeCovariance(trunk.smoother_id);
    prediction.is_placed =
        !view.has_ranges || 3 * std::sqrt(tracking.covariance(2, 2)) * prediction.range < 2 * trunk.trunk.radius();
    tracking.covariance(2, 2) += prediction.missed_variance;
    tracking.range = elevationOf(tracking.relative, trunk.trunk, view, options);
    tracking.left_contrast = trunk.left_contrast;
    tracking.right_contrast = trunk.right_contrast;
    const HiddenBorders hidden = hiddenBorders(trunk.trunk, trunk.id, map, view);
    tracking.left_hidden = hidden.left;
    tracking.right_hidden = hidden.right;
    predicted.push_back(prediction);
  }
  return predicted;
}

std::vector<InhibitedRange> inhibitedRanges(const TrunkMap &map, const Viewpoint &view, bool by_candidates)
{
  constexpr double kBefore = 0.3;  // less far ahead a trunk is beside the image [m]
  constexpr double kMargin_px = 1; // a border in the image is as wide
  std::vector<InhibitedRange> ranges;
  const Eigen::Vector2d forward = view.wMc.R.col(2).head<2>().normalized(), left(-forward.y(), forward.x());
  for (const std::size_t i : map.active()) {
    const MapTrunk &trunk = map.trunks()[i];
    const Eigen::Vector2d w = horizontalView(view.wMc, trunk.trunk).offset;
    const double r = trunk.trunk.radius(), d2 = w.squaredNorm();
    const bool inhibits =
        trunk.status == TrunkStatus::confirmed || (by_candidates && trunk.status == TrunkStatus::candidate);
    if (!inhibits || w.dot(forward) < kBefore || d2 < 1.1 * r * r)
      continue;
    const double q = w.dot(left) / w.dot(forward), half = r / std::sqrt(d2 - r * r) + kMargin_px / view.camera.fx;
    ranges.push_back({q - half, q + half});
  }
  return ranges;
}
} // namespace bole
