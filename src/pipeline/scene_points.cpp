// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/scene_points.h"

#include "geometry/horizontal_view.h"

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

/// The part of the image that is surely inside a trunk.
struct Inside
{
  double half_angle = 0;
  ElevationRange part;
  double bark = 0; ///< inverse distance of the bark [1/m]
};

std::optional<Inside> insideOf(const MapTrunk &trunk, const Viewpoint &view, const StageOptions &options)
{
  const HorizontalView seen = horizontalView(view.wMc, trunk.trunk);
  const double radius = trunk.trunk.radius();
  const RelativeTrunk relative = relativeTrunk(view.wMc, Pose(), trunk.trunk);
  if (seen.range > options.map.through_range || seen.range < radius + kNotInside || !relative.isFinite())
    return std::nullopt;
  Inside inside;
  inside.half_angle = std::min(kInside * seen.half_angle, seen.half_angle - kBorder_px / view.camera.fx);
  if (inside.half_angle <= 0)
    return std::nullopt;
  inside.part = elevationOf(relative, trunk.trunk, view, options);
  inside.bark = 1 / (seen.range - radius);
  return inside;
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
    const std::optional<Inside> inside = insideOf(trunk, view, options);
    if (!inside)
      continue;
    const double range = horizontalView(view.wMc, trunk.trunk).range;
    PointCount count{trunk.id, 0, 0};
    for (const TriangulatedRay &point : points) {
      const double level = point.ray.head<2>().norm(), slope = point.ray.z() / level;
      if (slope < inside->part.low || slope > inside->part.high || point.sigma > kKnown * inside->bark * level)
        continue;
      const Eigen::Vector2d w = trunk.trunk.axisAt(view.wMc.t.z() + slope * range).head<2>() - view.wMc.t.head<2>();
      const double apart = std::atan2(point.ray.y(), point.ray.x()) - std::atan2(w.y(), w.x());
      if (std::abs(std::remainder(apart, 2 * M_PI)) > inside->half_angle)
        continue;
      const double beyond =
          (inside->bark - point.inverse_distance / level) / std::hypot(point.sigma / level, kRangeSigma * inside->bark);
      count.behind += beyond > kBehind;
      count.on += std::abs(beyond) <= kBehind; // else before it: leaves, another trunk
    }
    counts.push_back(count);
  }
  return counts;
}
} // namespace bole
