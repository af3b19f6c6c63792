// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/report.h>

namespace bole
{
std::vector<Eigen::Vector3d> placedPoints(const FrameReport &report, double range)
{
  constexpr double kPlaced = 15; // inverse distance over its sigma: 7 per cent
  std::vector<Eigen::Vector3d> points;
  for (const TriangulatedRay &point : report.points)
    if (point.inverse_distance > kPlaced * point.sigma && point.inverse_distance * range > 1)
      points.emplace_back(report.wMc.t + point.ray / point.inverse_distance);
  return points;
}

const KnownTrunk *knownTrunk(const FrameReport &report, int id)
{
  for (const KnownTrunk &trunk : report.map)
    if (trunk.id == id && trunk.status != TrunkStatus::lost)
      return &trunk;
  return nullptr;
}

const TrunkInView *trackedTrunk(const FrameReport &report, int id)
{
  for (const TrunkInView &trunk : report.trunks)
    if (trunk.id == id && trunk.is_tracked)
      return &trunk;
  return nullptr;
}
} // namespace bole
