// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/flight_laws.h>

#include "geometry/failure.h"

#include <Eigen/Geometry>

#include <algorithm>

namespace bole
{
namespace
{
constexpr double kComeBack = 0.5; ///< from beyond a limit, no faster [m/s]

/// Speed that may be ordered towards a limit \p way ahead, by a drone that flies there at \p speed.
double towardsLimit(double way, double speed, double coast_s)
{
  return std::max((way - coast_s * speed) / coast_s, -kComeBack);
}
} // namespace

void FlightLawOptions::validate() const
{
  requireRange("hover_after_s", hover_after_s, 0.05, 2);
  requireRange("land_after_s", land_after_s, hover_after_s, 60);
  requireRange("fence", fence, 1, 1e5);
  requireRange("lowest", lowest, 0, 5);
  requireRange("highest", highest, lowest, 100);
  requireRange("least_battery", least_battery, 0, 1);
  requireRange("coast_s", coast_s, 0.1, 5);
}

FlightLaws::FlightLaws(const FlightLawOptions &options) : m_options(options) { m_options.validate(); }

void FlightLaws::takeOff(double time_s)
{
  m_renewed_s = m_told_s = time_s;
  m_home.reset();
}

FlightOrder FlightLaws::apply(double time_s, const std::optional<Eigen::Vector4d> &wanted,
                              const std::optional<OwnState> &own)
{
  using Kind = FlightOrder::Kind;
  const Eigen::Vector4d rest = Eigen::Vector4d::Zero();
  if (own) {
    m_told_s = time_s;
    if (!m_home)
      m_home = own->place;
  }
  if (time_s - m_renewed_s > m_options.land_after_s)
    return {Kind::lands, rest, "no command"};
  if (time_s - m_told_s > m_options.land_after_s)
    return {Kind::lands, rest, "no navdata"};
  if (own && own->battery < m_options.least_battery)
    return {Kind::lands, rest, "battery"};
  if (!wanted)
    return {Kind::hovers, rest, ""};
  if (time_s - m_renewed_s > m_options.hover_after_s)
    return {Kind::hovers, rest, "no command"};
  if (!own)
    return {Kind::hovers, rest, "no navdata"};
  FlightOrder order{Kind::flies, rest, ""};
  order.velocity = limited(*wanted, *own, order.law);
  return order;
}

Eigen::Vector4d FlightLaws::limited(const Eigen::Vector4d &wanted, const OwnState &own, const char *&law) const
{
  Eigen::Vector4d velocity = wanted;
  const Eigen::Vector2d from_home = own.place - *m_home;
  const double away = from_home.norm();
  if (away > 1e-6) {
    const Eigen::Vector2d out = Eigen::Rotation2Dd(-own.yaw) * Eigen::Vector2d(from_home / away);
    const double most = towardsLimit(m_options.fence - away, own.velocity.head<2>().dot(out), m_options.coast_s);
    const double too_fast = velocity.head<2>().dot(out) - most;
    if (too_fast > 0) {
      velocity.head<2>() -= too_fast * out;
      law = "fence";
    }
  }
  if (own.height > 0) {
    const double climb = own.velocity.z(), up = towardsLimit(m_options.highest - own.height, climb, m_options.coast_s),
                 down = towardsLimit(own.height - m_options.lowest, -climb, m_options.coast_s);
    velocity.z() = std::clamp(velocity.z(), std::min(-down, up), up);
  }
  else
    velocity.z() = 0;
  if (velocity.z() != wanted.z())
    law = "height";
  return velocity;
}
} // namespace bole
