// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/trunk_measurement.h"

#include "detection/border_continuity.h"
#include "geometry/silhouette.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace bole
{
bool isInsideGate(const TrackingPrediction &prediction, const TrackingResult &result, double fx,
                  const FlowOptions &options)
{
  constexpr double kTaper = 0.05; // of log(r/d): the radius at one height against that at another
  const Eigen::Vector2d innovation = result.optimum.minus(prediction.relative).tail<2>();
  const double sigma = options.gate_sigma_px / fx;
  Eigen::Matrix2d S = prediction.covariance.bottomRightCorner<2, 2>();
  S(0, 0) += sigma * sigma;
  S(1, 1) += std::pow(sigma / prediction.relative.ratio(), 2) + kTaper * kTaper;
  if (!result.left_used || !result.right_used) // one border: the width is the prediction's
    return innovation(0) * innovation(0) <= options.gate * S(0, 0);
  return innovation.dot(S.inverse() * innovation) <= options.gate;
}

double meanSquaredInnovation(const TrackingResult &result, const RelativeTrunk &expected, double fx,
                             const FlowOptions &options)
{
  constexpr double kMost = 9;     // [px^2]: farther off is wrong, however far
  constexpr double kWide_px = 20; // width from which the borders are rough by more than noise
  constexpr double kFaint = 1e-3; // least contrast [full scale/px]
  const bool has_both = result.left_used && result.right_used;
  const Eigen::Vector2d moved = fx * result.optimum.minus(expected).tail<2>();
  const double widened = has_both ? moved(1) * result.optimum.ratio() : 0;
  const double width_px = 2 * fx * result.optimum.ratio();
  const double left = std::abs(result.left_contrast), right = std::abs(result.right_contrast);
  const double weakest = std::max(has_both ? std::min(left, right) : left + right, kFaint);
  return std::min(moved(0) * moved(0) + widened * widened, kMost) /
         (1 + std::pow(width_px / kWide_px, 2) + std::pow(options.contrast_noise / weakest, 2));
}

double weightOfView(const std::optional<Eigen::Vector3d> &before, const Eigen::Vector3d &camera,
                    const FlowOptions &options)
{
  constexpr double kLeast = 0.05; // holds the pose of a drone at rest
  if (options.view_correlation <= 0 || !before)
    return 1;
  return std::clamp((camera - *before).norm() / options.view_correlation, kLeast, 1.0);
}

SummaryFactor summaryOf(const TrackingResult &result, double weight)
{
  return {result.optimum, weight * result.energy, weight * result.f, weight * result.F};
}

TrunkView viewOf(const TrackingResult &result, const RelativeTrunk &expected, const Trunk &trunk, const Viewpoint &view,
                 const FlowOptions &options)
{
  TrunkView seen;
  seen.time_s = view.time_s;
  seen.bearing = horizontalView(view.wMc, trunk).bearing;
  seen.half_angle = std::asin(std::min(result.optimum.ratio(), 1.0));
  seen.left_contrast = result.left_contrast;
  seen.right_contrast = result.right_contrast;
  seen.evenness = result.evenness;
  seen.innovation2 = meanSquaredInnovation(result, expected, view.camera.fx, options);
  seen.camera = view.wMc.t;
  return seen;
}

namespace
{
/// Borders of the other sign where the trunk is expected, also without what its misses add to the search.
bool isFlippedNear(const PredictedTrunk &predicted, const TrackingResult &result, double fx, const FlowOptions &options)
{
  TrackingPrediction narrow = predicted.tracking;
  narrow.covariance(2, 2) -= predicted.missed_variance;
  return result.status == TrackingStatus::sign_changed && isInsideGate(narrow, result, fx, options);
}
} // namespace

std::vector<TrackedTrunk> trackTrunks(const vpImage<unsigned char> &image, const Gradient &gradient,
                                      const std::vector<PredictedTrunk> &predicted, const TrunkMap &map,
                                      const Viewpoint &view, const StageOptions &options)
{
  const FlowOptions &flow = options.flow;
  std::vector<TrackedTrunk> seen;
  for (const PredictedTrunk &prediction : predicted) {
    TrackedTrunk tracked;
    tracked.predicted = prediction;
    TrackingResult &result = tracked.result;
    result = trackTrunk(gradient, view.camera, prediction.tracking, options.tracking);
    if (result.status == TrackingStatus::tracked && !isInsideGate(prediction.tracking, result, view.camera.fx, flow))
      result.status = TrackingStatus::diverged;
    tracked.is_flipped = isFlippedNear(prediction, result, view.camera.fx, flow);
    const int flipped_in_a_row = map.trunk(prediction.id).flipped_in_a_row + 1;
    if (tracked.is_flipped && flow.turned_frames > 0 && flipped_in_a_row >= flow.turned_frames)
      result.status = TrackingStatus::tracked;
    if (result.status == TrackingStatus::tracked)
      tracked.continuity = continuityOf(image, view.camera, result.optimum,
                                        textureRange(result.optimum, map.trunk(prediction.id).trunk, view, options));
    seen.push_back(tracked);
  }
  return seen;
}

TrunkMeasurement measurementOf(const TrackedTrunk &tracked, const TrunkMap &map, const Viewpoint &view,
                               const FlowOptions &options)
{
  const TrackingStatus status = tracked.result.status;
  const PredictedTrunk &predicted = tracked.predicted;
  TrunkMeasurement measurement;
  measurement.id = predicted.id;
  measurement.is_flipped = tracked.is_flipped;
  if (status == TrackingStatus::tracked) {
    measurement.kind = TrunkMeasurement::Kind::seen;
    measurement.view =
        viewOf(tracked.result, predicted.tracking.relative, map.trunk(predicted.id).trunk, view, options);
    measurement.view.continuity = tracked.continuity;
  }
  else if (status == TrackingStatus::occluded || status == TrackingStatus::not_visible)
    measurement.kind = TrunkMeasurement::Kind::hidden;
  return measurement;
}
} // namespace bole
