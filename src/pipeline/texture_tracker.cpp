// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/texture_tracker.h"

#include <Eigen/Geometry>

#include <cmath>

namespace bole
{
namespace
{
constexpr double kMeasurement_px = 1; ///< standard deviation of a bearing by the borders of one image
constexpr double kMostSigma_px = 1.2; ///< of a bearing by the bark: more, and the borders are looked for anew

/// The trunk turned about the camera by \p angle [rad] to the left.
Trunk turnedAbout(const Pose &camera, Trunk trunk, double angle)
{
  const Eigen::Vector2d at = camera.t.head<2>();
  trunk.xy = at + Eigen::Rotation2Dd(angle) * (trunk.xy - at);
  return trunk;
}

/// Kalman update of a prediction by a bearing that lies \p angle to its left.
void updateBearing(TrackingPrediction &prediction, double angle, double variance)
{
  Matrix4d &P = prediction.covariance;
  const Vector4d gain = P.col(2) / (P(2, 2) + variance);
  prediction.relative = prediction.relative.plus(Vector4d(gain * angle));
  P -= Matrix4d(gain * P.row(2));
  P = Matrix4d(0.5 * (P + P.transpose()));
}
} // namespace

void TextureTracker::predict(const vpImage<unsigned char> &image, std::size_t pose, const Pose &before,
                             const Viewpoint &view, const TrunkMap &map, std::vector<PredictedTrunk> &predicted)
{
  constexpr double kSigmas = 3; // of the prediction, within which the bark is looked for
  std::unordered_map<int, FilteredBearing> known;
  known.swap(m_tracked);
  const bool is_next = m_pose > 0 && m_pose + 1 == pose;
  for (PredictedTrunk &one : predicted) {
    const auto filtered = known.find(one.id);
    if (!is_next || filtered == known.end() || map.trunk(one.id).status != TrunkStatus::confirmed)
      continue; // a candidate is tracked by its borders alone, since they decide whether it is confirmed
    TrackingPrediction &prediction = one.tracking;
    const Trunk &trunk = map.trunk(one.id).trunk;
    const RelativeTrunk there = relativeTrunk(before, Pose(), trunk), here = relativeTrunk(view.wMc, Pose(), trunk);
    const double variance = prediction.covariance(2, 2) - one.missed_variance;
    if (!there.isFinite() || !here.isFinite())
      continue;
    const double offset = filtered->second.seen.minus(there)(2);
    const auto shift =
        textureShift({m_image, before}, {image, view.wMc}, view.camera, turnedAbout(before, trunk, offset),
                     prediction.range, kSigmas * std::sqrt(variance) * view.camera.fx);
    if (!shift)
      continue;
    // what is wrong in the step shifts the axis, which stands behind the bark, by less
    const double angle = offset + (1 - here.ratio()) * shift->angle;
    const FilteredBearing now{here.plus(Vector4d(0, 0, angle, 0)), filtered->second.variance + shift->variance};
    if (now.variance > std::pow(kMostSigma_px / view.camera.fx, 2))
      continue;
    m_tracked[one.id] = now;
    prediction.covariance(2, 2) = variance; // it was not lost from sight
    one.missed_variance = 0;
    updateBearing(prediction, now.seen.minus(prediction.relative)(2), now.variance);
  }
  m_image = image;
  m_pose = pose;
}

void TextureTracker::correct(const std::vector<TrackedTrunk> &tracked, const PinholeCamera &camera)
{
  const double measured_variance = std::pow(kMeasurement_px / camera.fx, 2);
  for (const TrackedTrunk &one : tracked) {
    if (one.result.status != TrackingStatus::tracked)
      continue;
    const auto [known, is_new] =
        m_tracked.try_emplace(one.predicted.id, FilteredBearing{one.result.optimum, measured_variance});
    if (is_new)
      continue;
    FilteredBearing &filtered = known->second;
    const double gain = filtered.variance / (filtered.variance + measured_variance);
    filtered.seen = filtered.seen.plus(Vector4d(0, 0, gain * one.result.optimum.minus(filtered.seen)(2), 0));
    filtered.variance *= 1 - gain;
  }
}
} // namespace bole
