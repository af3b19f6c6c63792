// SPDX-License-Identifier: GPL-2.0-or-later
// The scale of the map, and the results in metres.
#include "pipeline/engine.h"

#include <cmath>
#include <limits>

namespace bole
{
/// The scale by the height over the ground and, with \p with_radii, by the radii of the trunks against their prior.
ScaleEstimate Engine::estimateScale(bool with_radii) const
{
  ScaleEstimate scale = m_motion->scale();
  if (!with_radii || scale.source != ScaleSource::prior)
    return scale;
  double weights = 0, sum = 0;
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (trunk.removed || trunk.status != TrunkStatus::confirmed)
      continue;
    const double weight = 1 / (std::pow(m_options.smoothing.prior_log_radius_sigma, 2) + trunk.covariance(2, 2));
    weights += weight;
    sum += weight * (std::log(m_options.smoothing.prior_radius) - trunk.trunk.log_radius);
  }
  if (weights == 0)
    return scale;
  const double from_height = 1 / (scale.sigma * scale.sigma);
  const double from_radii =
      1 / (kSigmaOfWoods * kSigmaOfWoods + 1 / weights); // which wood it is, no count averages out
  const double information = from_height + from_radii;
  return {(from_height * scale.log_scale + from_radii * sum / weights) / information, 1 / std::sqrt(information),
          scale.source};
}

/// Lets the metres follow the scale. The radii count only at the end: the detector looks for trunks of usual size, so
/// at any scale it finds some that look it, and a scale that follows them runs away.
void Engine::updateScale(double seconds_passed)
{
  constexpr double kAtOnce = 0.1;  // of the log of the scale: as much changes decisions
  constexpr double kFollows_s = 2; // below that, at a pace that nobody takes for a motion
  if (!m_motion->hasRanges())
    return;
  const double log_metres = std::log(m_metres), off = estimateScale(false).log_scale - log_metres;
  const double share = std::abs(off) > kAtOnce ? 1 : 1 - std::exp(-seconds_passed / kFollows_s);
  m_metres = std::exp(log_metres + share * off);
  if (std::abs(std::log(m_metres / m_metres_of_units)) > kAtOnce)
    setUnits();
}

/// Fixes the scale at the end of the flight, by the radii of the trunks too.
void Engine::fixScale()
{
  if (!m_motion->hasRanges())
    return;
  m_metres = std::exp(estimateScale(true).log_scale);
  setUnits();
}

void Engine::setUnits()
{
  m_metres_of_units = m_metres;
  m_units = inUnits(m_options, m_metres);
  m_map.setOptions(m_units.map);
  m_saliency = SaliencyEstimator(m_camera, m_units.saliency);
}

/// By the plane of the pose that was nearest.
double Engine::groundAt(const Eigen::Vector2d &xy) const
{
  double nearest = std::numeric_limits<double>::infinity(), z = 0;
  for (std::size_t pose = 0; pose < m_ground.size(); ++pose)
    if (const auto &plane = m_ground[pose]; plane && (cameraAt(pose).t.head<2>() - xy).norm() < nearest) {
      nearest = (cameraAt(pose).t.head<2>() - xy).norm();
      z = plane->heightAt(xy);
    }
  return z;
}

std::vector<TrunkRecord> Engine::map() const
{
  std::vector<TrunkRecord> records;
  if (!m_motion)
    return records;
  const Eigen::Vector2d origin = m_smoother.pose(0).t.head<2>() * m_metres;
  const double sigma = m_motion->hasRanges() ? estimateScale(true).sigma : 0;
  const auto ground_z = [this](const Eigen::Vector2d &xy) { return groundAt(xy); };
  for (const TrunkRecord &in_units : m_map.records(ground_z, kBreastHeight / m_metres, m_motion->hasRanges())) {
    TrunkRecord record = inMetres(in_units, m_metres);
    Vector5d by_log_scale;
    by_log_scale << record.xy - origin, record.radius, 0, 0;
    record.covariance += sigma * sigma * by_log_scale * by_log_scale.transpose();
    records.push_back(record);
  }
  return records;
}

WorldReference Engine::reference() const
{
  if (!m_motion)
    return {};
  WorldReference reference = m_motion->reference();
  const ScaleEstimate scale = estimateScale(true);
  if (scale.source != ScaleSource::odometry) {
    reference.scale = scale.source;
    reference.scale_sigma = scale.sigma;
  }
  return reference;
}

Trajectory Engine::smoothedTrajectory() const
{
  Trajectory trajectory;
  for (std::size_t i = 0; i < m_online.size(); ++i)
    trajectory.push_back({m_online[i].stamp_ns, inMetres(m_smoother.pose(i), m_bMc, m_metres)});
  return trajectory;
}

Trajectory Engine::onlineTrajectory() const
{
  Trajectory trajectory = m_online;
  for (StampedPose &pose : trajectory)
    pose.wMb = inMetres(pose.wMb, m_bMc, m_metres);
  return trajectory;
}

Graph Engine::graph() const { return m_metres == 1 ? m_smoother.graph() : scaled(m_smoother.graph(), m_metres); }
} // namespace bole
