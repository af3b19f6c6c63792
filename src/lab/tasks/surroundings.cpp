// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/surroundings.h"

#include "support/units.h"

#include <algorithm>

namespace bole
{
void Surroundings::see(const FrameReport &report)
{
  const double time_s = secondsOf(report.stamp_ns);
  m_near_points.see(placedPoints(report, kNearRange), report.wMb, time_s);
  m_seen.see(report.points, report.wMc.t, time_s);
  m_seen.stand(report.wMb.t.head<2>());
}

std::vector<Obstacle> Surroundings::surfaces(const FrameReport &report, double range, int observations) const
{
  std::vector<Obstacle> surfaces = obstacles(report, range, observations);
  m_near_points.addTo(surfaces, report.wMb, std::min(range, kNearRange));
  return surfaces;
}

Eigen::Vector2d safeVelocity(const Eigen::Vector2d &velocity, const Eigen::Vector2d &p, const Eigen::Vector2d &rest,
                             const std::vector<Obstacle> &surfaces, const Surroundings &around,
                             const SafetyOptions &options)
{
  constexpr double kLook = 0.1; // between the places asked [m]
  Eigen::Vector2d safe = velocity;
  for (const Obstacle &surface : surfaces) {
    const Eigen::Vector2d w = surface.xy - p;
    const double distance = w.norm();
    if (!surface.is_confirmed || surface.evidence < 0 || distance < 1e-6)
      continue;
    const Eigen::Vector2d u = w / distance;
    const double way = distance - surface.radius - options.hull - options.least_free - std::max(0.0, (rest - p).dot(u));
    safe -= std::max(0.0, safe.dot(u) - std::max(0.0, way / options.stopping_s)) * u;
  }
  const double speed = safe.norm();
  if (speed <= options.unseen_speed)
    return safe;
  const Eigen::Vector2d ahead = safe / speed;
  const double coast = std::max(0.0, (rest - p).dot(ahead)), wanted = coast + speed * options.stopping_s;
  double free = 0;
  while (free < wanted && around.roomAt(p + free * ahead) >= options.hull + options.least_free)
    free += kLook;
  return safe * (std::clamp((free - coast) / options.stopping_s, options.unseen_speed, speed) / speed);
}
} // namespace bole
