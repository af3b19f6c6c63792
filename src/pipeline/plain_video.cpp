// SPDX-License-Identifier: GPL-2.0-or-later
// What the pipeline does with a video that has no pose filter: steps from points, the metre from heights or radii.
#include <bole/pipeline.h>

#include <cmath>

namespace bole
{
MotionStep Pipeline::visualStep(const Frame &frame, const MotionStep &predicted, std::vector<VisualLink> &links)
{
  const Pose wMa = m_smoother.pose(m_smoother.poseCount() - 1);
  std::optional<GyroRotation> turned;
  if (predicted.turn_from_gyro) {
    turned.emplace();
    turned->R = m_bMc.R.transpose() * predicted.aMb.R * m_bMc.R;
    turned->white = m_bMc.R.transpose() * predicted.covariance.bottomRightCorner<3, 3>() * m_bMc.R;
    turned->complete = true;
  }
  VisualStep visual = m_visual->step(frame, m_points.tracker(), predicted, wMa, turned);
  links = std::move(visual.links);
  visual.step.step_from_odometry = visual.has_length;
  if (m_visual->heightSeen())
    learnGround(wMa * visual.step.aMb);
  return visual.step;
}

/// What was held by its bearing alone has a guess for its range: it would pull on the path that now has a length.
void Pipeline::forgetUnranged()
{
  for (const int id : m_map.removeAll())
    if (const std::size_t smoother_id = m_map.trunks()[static_cast<std::size_t>(id)].smoother_id;
        m_smoother.hasTrunk(smoother_id))
      m_smoother.removeTrunk(smoother_id);
}

/// The ground under the camera, smoothed: bumps and slopes of some metres stay.
void Pipeline::learnGround(const Pose &wMb)
{
  const double seen = (wMb * m_bMc).t.z() - *m_visual->heightSeen();
  constexpr double kMemory = 0.9;
  m_ground_z = m_ground_z ? kMemory * *m_ground_z + (1 - kMemory) * seen : seen;
}

/// The metre from a height over the ground where one is known, else from what a height usually is and the radii of the
/// trunks against their prior.
Pipeline::ScaleEstimate Pipeline::estimateScale(bool with_radii) const
{
  const VisualOdometry::Correction height = m_visual->fromHeight();
  if (m_visual->isHeightKnown() || !with_radii)
    return {height.log_scale, height.sigma, m_visual->isHeightKnown() ? ScaleSource::height : ScaleSource::prior};
  double information = 1 / (height.sigma * height.sigma), sum = information * height.log_scale;
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (trunk.removed || trunk.status != TrunkStatus::confirmed)
      continue;
    const double variance = std::pow(m_options.smoothing.prior_log_radius_sigma, 2) + trunk.covariance(2, 2);
    sum += (std::log(m_options.smoothing.prior_radius) - trunk.trunk.log_radius) / variance;
    information += 1 / variance;
  }
  return {sum / information, 1 / std::sqrt(information), ScaleSource::prior};
}

/// Takes the scale to where it belongs, when it is off by more than \p least_correction (of its log). The radii have
/// their say only at the end: the detector looks for trunks of usual size, so at any scale it finds some that look it,
/// and a scale that follows them runs away.
void Pipeline::reviewScale(double least_correction, bool with_radii)
{
  if (!m_visual || isTurning())
    return;
  const ScaleEstimate scale = estimateScale(with_radii);
  if (std::abs(scale.log_correction) > least_correction)
    rescale(std::exp(scale.log_correction));
}

void Pipeline::rescale(double factor)
{
  Graph graph = m_smoother.graph();
  if (graph.poses.size() != m_smoother.poseCount())
    return; // a fixed lag has closed poses: they keep their scale
  graph = scaled(graph, factor);
  m_sights.clear();             // in the old metre
  std::vector<MapTrunk *> kept; // in the order of the graph: that of their ids
  for (std::size_t id = 0; id < m_smoother.trunkCount(); ++id)
    for (MapTrunk &trunk : m_map.trunks())
      if (trunk.smoother_id == id && !trunk.removed && m_smoother.hasTrunk(id))
        kept.push_back(&trunk);
  m_smoother = Smoother(graph, m_smoother.options());
  for (std::size_t id = 0; id < kept.size(); ++id)
    kept[id]->smoother_id = id;
  m_smoother.optimize(1e-6, 10);
  for (MapTrunk &trunk : m_map.trunks()) {
    if (trunk.removed) {
      trunk.trunk.xy *= factor;
      trunk.trunk.log_radius += std::log(factor);
    }
    trunk.covariance.topRows<2>() *= factor;
    trunk.covariance.leftCols<2>() *= factor;
  }
  refreshWholeMap();
  for (StampedPose &pose : m_online)
    pose.wMb.t *= factor;
  if (m_ground_z)
    *m_ground_z *= factor;
  m_velocity.head<3>() *= factor;
  m_visual->rescale(factor);
  m_saliency.reset(); // its evidence is of ranges in metres
}

WorldReference Pipeline::reference() const
{
  WorldReference reference;
  if (!m_visual) {
    if (!m_ground_z) {
      reference.scale = ScaleSource::prior;
      reference.gravity = GravitySource::assumed;
    }
    return reference;
  }
  const ScaleEstimate scale = estimateScale(true);
  reference.scale = scale.source;
  reference.scale_sigma = scale.sigma;
  reference.gravity = m_visual->knowsUp() ? GravitySource::trunks : GravitySource::assumed;
  reference.gravity_sigma = m_visual->knowsUp() ? m_visual->upSigma() : 0;
  reference.has_ranges = !isTurning();
  return reference;
}
} // namespace bole
