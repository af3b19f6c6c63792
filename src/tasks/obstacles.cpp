// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/tasks/obstacles.h>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kMisread = 0.3; ///< of the radius: a border read inside the bark, where light and shade meet
constexpr double kDoubted = -2;  ///< log odds below which a candidate is taken for nothing
constexpr double kFlownThrough = 0.1; ///< of the drone from the bark: what stands there is none [m]
} // namespace

double Obstacle::clearance(const Eigen::Vector2d &p, double sigmas) const
{
  const Eigen::Vector2d away = p - xy;
  const double distance = away.norm();
  if (distance < 1e-9)
    return -radius;
  const Eigen::Vector2d u = away / distance;
  return distance - radius - sigmas * std::sqrt(std::max(0.0, u.dot(covariance * u)));
}

std::vector<Obstacle> obstacles(const Pipeline &pipeline, const Pose &wMb, double range, int observations)
{
  std::vector<Obstacle> near;
  for (const MapTrunk &trunk : pipeline.mapTrunks()) {
    const bool is_confirmed = trunk.status == TrunkStatus::confirmed;
    const bool counts = is_confirmed || (trunk.status == TrunkStatus::candidate && trunk.observations >= observations);
    if (trunk.removed || !counts) // most of a long flight's
      continue;
    const Eigen::Vector2d xy = trunk.trunk.axisAt(wMb.t.z()).head<2>(), w = xy - wMb.t.head<2>();
    const double d = w.norm();
    const double evidence = pipeline.evidence(trunk);
    if (d > range || d < trunk.trunk.radius() + kFlownThrough || (!is_confirmed && evidence < kDoubted))
      continue;
    const Matrix4d relative = pipeline.smoother().relativeCovariance(trunk.smoother_id);
    const double across = d * d * relative(2, 2), along = d * d * trunk.covariance(2, 2);
    const Eigen::Vector2d u = w / d, n(-u.y(), u.x());
    const double misread = kMisread * trunk.trunk.radius();
    near.push_back({trunk.id, is_confirmed, xy, trunk.trunk.radius(),
                    across * n * n.transpose() + along * u * u.transpose() + misread * misread * Eigen::Matrix2d::Identity(),
                    evidence});
  }
  return near;
}

Eigen::Vector2d keptClear(Eigen::Vector2d velocity, const Eigen::Vector2d &p, const std::vector<Obstacle> &trunks,
                          double body_radius, double evidence)
{
  constexpr double kDamping = 0.7; // [1/s]: the drone's lag is about half a second
  constexpr double kLeast = 0.12;  // free way at which nothing more leads nearer [m]
  for (const Obstacle &trunk : trunks) {
    const Eigen::Vector2d w = trunk.xy - p;
    const double distance = w.norm();
    if (!trunk.is_confirmed || trunk.evidence < evidence || distance < 1e-6)
      continue;
    const Eigen::Vector2d u = w / distance;
    const double most = std::max(0.0, kDamping * (distance - trunk.radius - body_radius - kLeast));
    velocity -= std::max(0.0, velocity.dot(u) - most) * u;
  }
  return velocity;
}
} // namespace bole
