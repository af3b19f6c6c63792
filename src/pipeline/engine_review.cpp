// SPDX-License-Identifier: GPL-2.0-or-later
// Reports of past frames by the map at the end of the flight.
#include "geometry/constants.h"
#include "geometry/failure.h"
#include "geometry/silhouette.h"
#include "pipeline/engine.h"

#include <algorithm>

namespace bole
{
void Engine::indexViews()
{
  m_views.clear();
  const Graph graph = m_smoother.graph();
  for (const Graph::ObservationEdge &view : graph.observations)
    m_views[static_cast<std::size_t>(graph.trunks[view.trunk].id) - m_smoother.poseCount()].push_back(
        static_cast<std::size_t>(graph.poses[view.pose].id));
  for (auto &[trunk, poses] : m_views)
    std::sort(poses.begin(), poses.end());
}

/// Whether a trunk was seen from a pose. A frame from the same place as another is no keyframe: it counts as a view
/// where the views before and after it do.
bool Engine::isSeen(const MapTrunk &trunk, std::size_t pose) const
{
  const auto found = m_views.find(trunk.smoother_id);
  if (found == m_views.end())
    return false;
  const std::vector<std::size_t> &views = found->second;
  const auto after = std::lower_bound(views.begin(), views.end(), pose);
  if (after == views.begin() || after == views.end() || *after == pose)
    return after != views.end() && *after == pose;
  const auto isEarlier = [](const Keyframe &frame, std::size_t other) { return frame.pose < other; };
  const auto &kept = m_keyframes.frames();
  return std::lower_bound(kept.begin(), kept.end(), *std::prev(after) + 1, isEarlier) ==
         std::lower_bound(kept.begin(), kept.end(), *after, isEarlier);
}

FrameReport Engine::review(std::size_t index) const
{
  if (index >= m_online.size())
    throw badValue("index = {}, must be below {}", index, m_online.size());
  FrameReport report;
  report.index = index;
  report.stamp_ns = m_online[index].stamp_ns;
  report.wMb = m_smoother.pose(index);
  report.wMc = cameraAt(index);
  report.has_ranges = m_motion->hasRanges();
  const Viewpoint view = viewpointOf(index, secondsOf(report.stamp_ns));
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (m_map.statusOf(trunk, report.has_ranges) != TrunkStatus::confirmed)
      continue;
    const HorizontalView from = horizontalView(view.wMc, trunk.trunk);
    const RelativeTrunk relative = relativeTrunk(view.wMc, Pose(), trunk.trunk);
    const bool is_seen = isSeen(trunk, index); // also beyond track_range: the final pass looks there, too
    if (!relative.isFinite() || relative.cRt(2, 0) <= 0 ||
        (view.has_ranges && !is_seen && from.range > m_units.flow.track_range))
      continue;
    const ElevationRange part = elevationOf(relative, trunk.trunk, view, m_units);
    report.trunks.push_back({trunk.id, TrunkStatus::confirmed, is_seen, "", relative, part.low, part.high,
                             view.has_ranges ? from.range : 0});
    const Eigen::Vector2d across(-from.offset.y() / from.range, from.offset.x() / from.range);
    const double variance = across.dot(trunk.place_covariance * across) / (from.range * from.range);
    report.map.push_back({trunk.id, TrunkStatus::confirmed, trunk.trunk, trunk.observations, m_map.evidence(trunk), 0,
                          trunk.covariance(2, 2), variance});
  }
  toMetres(report, m_bMc, m_metres);
  return report;
}
} // namespace bole
