// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/scene_points.h"

#include "geometry/silhouette.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kRaySigma = 0.004; ///< of the angle between two rays [rad]: of the points and of the rotation between
constexpr double kMissed = 2;       ///< largest distance of the rays from one another, in sigmas
constexpr double kMiddle_px = 2;    ///< largest error in the frame half-way

constexpr double kInside = 0.7;    ///< part of the half width of a trunk that is surely inside it
constexpr double kBorder_px = 4;   ///< least distance from its borders, where corners slide along the bark
constexpr double kNotInside = 0.3; ///< least distance of the camera from the bark [m]
constexpr double kKnown = 0.25; ///< largest sigma of a point's inverse distance over the inverse distance of the trunk
constexpr double kRangeSigma = 0.1; ///< of the range of the trunk, relative
constexpr double kBehind = 2.5;     ///< sigmas behind the bark, or before it

// A strip beside a border begins beyond what slides along the border, and is as wide as the trunk, or as pixels that
// hold a corner.
constexpr double kGap_px = 3, kStrip_px = 10;
constexpr double kFarther = 1.2;     ///< times the range of the trunk: behind it; what recedes like a wall is not
constexpr double kKnownBeside = 0.1; ///< largest sigma of a point's inverse distance, as kKnown: half of kFarther

/// The parts of the image that are surely inside a trunk, and beside it.
struct Parts
{
  double half_angle = 0, strip_begin = 0, strip_end = 0; ///< [rad] from its axis
  double range = 0;                                      ///< [m]
  ElevationRange part;
  double bark = 0; ///< inverse distance of the bark [1/m]
};

std::optional<Parts> partsOf(const MapTrunk &trunk, const Viewpoint &view, const StageOptions &options)
{
  const HorizontalView seen = horizontalView(view.wMc, trunk.trunk);
  const double radius = trunk.trunk.radius();
  const RelativeTrunk relative = relativeTrunk(view.wMc, Pose(), trunk.trunk);
  if (seen.range > options.flow.track_range || seen.range < radius + kNotInside || !relative.isFinite())
    return std::nullopt;
  Parts parts;
  parts.half_angle = seen.range > options.map.through_range
                         ? 0
                         : std::min(kInside * seen.half_angle, seen.half_angle - kBorder_px / view.camera.fx);
  parts.strip_begin = seen.half_angle + kGap_px / view.camera.fx;
  parts.strip_end = parts.strip_begin + std::max(2 * seen.half_angle, kStrip_px / view.camera.fx);
  parts.range = seen.range;
  parts.part = elevationOf(relative, trunk.trunk, view, options);
  parts.bark = 1 / (seen.range - radius);
  return parts;
}
} // namespace

/// The point now.t + ray / w lies on the ray seen before where a x (ray + w base) = 0: least squares in w.
std::vector<TriangulatedRay> triangulate(const PointTracker &tracker, const std::vector<Pose> &wMc,
                                         const PinholeCamera &camera)
{
  std::vector<TriangulatedRay> points;
  if (wMc.empty())
    return points;
  const Pose &now = wMc.front();
  for (const PointTrack &track : tracker.tracks()) {
    const int back = std::min<int>(track.age(), static_cast<int>(wMc.size()) - 1);
    if (back < 2)
      continue;
    const auto seen = [&track](int ago) { return *(track.positions_px.rbegin() + ago); };
    const Pose &before = wMc[static_cast<std::size_t>(back)];
    const Eigen::Vector3d a = (before.R * camera.ray(seen(back))).normalized();
    const Eigen::Vector3d ray = (now.R * camera.ray(seen(0))).normalized();
    const Eigen::Vector3d base = now.t - before.t, by_rotation = a.cross(ray), by_base = a.cross(base);
    const double across = (base - base.dot(ray) * ray).norm();
    if (across < 1e-3 || by_base.squaredNorm() < 1e-6)
      continue;
    const double w = -by_rotation.dot(by_base) / by_base.squaredNorm();
    if ((by_rotation + w * by_base).norm() > kMissed * kRaySigma)
      continue;
    const Pose &half_way = wMc[static_cast<std::size_t>(back / 2)];
    const Eigen::Vector3d c = half_way.R.transpose() * (ray + w * (now.t - half_way.t)); // the point times w
    if (c.z() > 0 && (camera.project(c) - seen(back / 2)).norm() < kMiddle_px)
      points.push_back({ray, w, kRaySigma / across});
  }
  return points;
}

std::vector<PointCount> countPoints(const std::vector<TriangulatedRay> &points, const TrunkMap &map,
                                    const Viewpoint &view, const StageOptions &options)
{
  std::vector<PointCount> counts;
  if (points.empty())
    return counts;
  for (const std::size_t i : map.active()) {
    const MapTrunk &trunk = map.trunks()[i];
    const std::optional<Parts> parts = partsOf(trunk, view, options);
    if (!parts)
      continue;
    PointCount count;
    count.id = trunk.id;
    for (const TriangulatedRay &point : points) {
      const double level = point.ray.head<2>().norm(), slope = point.ray.z() / level;
      const double inverse = point.inverse_distance / level, sigma = point.sigma / level;
      if (slope < parts->part.low || slope > parts->part.high)
        continue;
      const Eigen::Vector2d w =
          trunk.trunk.axisAt(view.wMc.t.z() + slope * parts->range).head<2>() - view.wMc.t.head<2>();
      const double apart =
          std::abs(std::remainder(std::atan2(point.ray.y(), point.ray.x()) - std::atan2(w.y(), w.x()), 2 * M_PI));
      if (apart <= parts->half_angle && sigma <= kKnown * parts->bark) {
        const double beyond = (parts->bark - inverse) / std::hypot(sigma, kRangeSigma * parts->bark);
        count.behind += beyond > kBehind;
        count.on += std::abs(beyond) <= kBehind; // else before it: leaves, another trunk
      }
      if (apart > parts->strip_begin && apart < parts->strip_end && sigma * parts->range < kKnownBeside) {
        const double nearness = inverse * parts->range;
        count.behind_beside += nearness < 1 / kFarther;
        count.beside += nearness >= 1 / kFarther && nearness <= kFarther;
      }
    }
    counts.push_back(count);
  }
  return counts;
}
} // namespace bole
