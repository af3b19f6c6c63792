// SPDX-License-Identifier: GPL-2.0-or-later
// What the points of the scene say beside the trunks: where something stands, and what the camera looks through.
#include <bole/pipeline.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr int kBack = 15;           ///< frames between the two views of a point, at most
constexpr double kRaySigma = 0.004; ///< of the angle between two rays [rad]: of the points, and of the turn between
constexpr double kMissed = 2;       ///< largest distance of the rays from one another, in sigmas
constexpr double kMiddle_px = 2;    ///< largest error in the frame half-way
constexpr double kPlaced = 15;      ///< inverse distance over its sigma from which a point has a place

constexpr double kInside = 0.7;     ///< of the half width of a trunk: what is surely inside it
constexpr double kBorder_px = 4;    ///< and the least distance from its borders, where corners slide along the bark
constexpr double kNotInside = 0.3;  ///< of its bark, at the least [m]
constexpr double kKnown = 0.25;     ///< largest sigma of a point's inverse distance, of the trunk's
constexpr double kRangeSigma = 0.1; ///< of the trunk's range, relative
constexpr double kBehind = 2.5;     ///< sigmas behind the bark, or before
} // namespace

/// The point now.t + ray / w lies on the ray seen before where a x (ray + w base) = 0: least squares in w.
void Pipeline::placeSights()
{
  if (m_points.framesBack() < 2 || isTurning())
    return;
  std::vector<Pose> wMc; // by frames back
  for (int back = 0; back <= std::min(kBack, m_points.framesBack()); ++back)
    wMc.push_back(cameraAt(poseOf(m_points.frameIndex(back))));
  const Pose &now = wMc.front();
  for (const PointTrack &track : m_points.tracker().tracks()) {
    const int back = std::min<int>(track.age(), static_cast<int>(wMc.size()) - 1);
    if (back < 2)
      continue;
    const auto seen = [&track](int ago) { return *(track.positions_px.rbegin() + ago); };
    const Pose &before = wMc[static_cast<std::size_t>(back)];
    const Eigen::Vector3d a = (before.R * m_camera.ray(seen(back))).normalized();
    const Eigen::Vector3d ray = (now.R * m_camera.ray(seen(0))).normalized();
    const Eigen::Vector3d base = now.t - before.t, turned = a.cross(ray), by_base = a.cross(base);
    const double across = (base - base.dot(ray) * ray).norm();
    if (across < 1e-3 || by_base.squaredNorm() < 1e-6)
      continue;
    const double w = -turned.dot(by_base) / by_base.squaredNorm();
    if ((turned + w * by_base).norm() > kMissed * kRaySigma)
      continue;
    const Pose &half_way = wMc[static_cast<std::size_t>(back / 2)];
    const Eigen::Vector3d c = half_way.R.transpose() * (ray + w * (now.t - half_way.t)); // the point times w
    if (c.z() > 0 && (m_camera.project(c) - seen(back / 2)).norm() < kMiddle_px)
      m_sights.push_back({ray, w, kRaySigma / across});
  }
}

std::vector<Eigen::Vector3d> Pipeline::scenePoints(double range) const
{
  std::vector<Eigen::Vector3d> points;
  for (const Sight &sight : m_sights)
    if (sight.inverse_distance > kPlaced * sight.sigma && sight.inverse_distance * range > 1)
      points.emplace_back(cameraPose().t + sight.ray / sight.inverse_distance);
  return points;
}

void Pipeline::lookThroughTrunks()
{
  if (m_sights.empty())
    return;
  const Pose wMc = cameraPose();
  for (const std::size_t i : m_map.active()) {
    MapTrunk &trunk = m_map.trunks()[i];
    const double range = (trunk.trunk.xy - wMc.t.head<2>()).norm(), radius = trunk.trunk.radius();
    const RelativeTrunk relative = relativeTrunk(wMc, Pose(), trunk.trunk);
    if (range > m_options.map.through_range || range < radius + kNotInside || !relative.isFinite())
      continue;
    const double half = std::asin(std::min(0.99, radius / range));
    const double inside = std::min(kInside * half, half - kBorder_px / m_camera.fx);
    if (inside <= 0)
      continue;
    const ElevationRange stem = elevation(relative, trunk.trunk, wMc);
    const double bark = 1 / (range - radius);
    for (const Sight &sight : m_sights) {
      const double level = sight.ray.head<2>().norm(), slope = sight.ray.z() / level;
      if (slope < stem.low || slope > stem.high || sight.sigma > kKnown * bark * level)
        continue;
      const Eigen::Vector2d w = trunk.trunk.axisAt(wMc.t.z() + slope * range).head<2>() - wMc.t.head<2>();
      if (std::abs(std::remainder(std::atan2(sight.ray.y(), sight.ray.x()) - std::atan2(w.y(), w.x()), 2 * M_PI)) >
          inside)
        continue;
      const double beyond =
          (bark - sight.inverse_distance / level) / std::hypot(sight.sigma / level, kRangeSigma * bark);
      if (beyond > kBehind)
        ++trunk.points_behind;
      else if (beyond > -kBehind) // else before it: leaves, another trunk
        ++trunk.points_on;
    }
  }
}
} // namespace bole
