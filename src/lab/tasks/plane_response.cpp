// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/plane_response.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kMemory_s = 5;        ///< of what was obeyed
constexpr double kLeastPath_m2 = 0.05; ///< flown before anything is said of it
constexpr double kLeastObeyed = 0.7, kMostObeyed = 1.3;
} // namespace

double PlaneResponse::obeyed() const
{
  return std::clamp((kLeastPath_m2 + m_flown) / (kLeastPath_m2 + m_sent), kLeastObeyed, kMostObeyed);
}

void PlaneResponse::see(const Eigen::Vector2d &place, double time_s)
{
  const double dt = time_s - m_time_s;
  const Eigen::Vector2d path = m_response.advance(time_s).head<2>();
  if (m_has_place) {
    const double keep = std::exp(-dt / kMemory_s);
    m_flown = keep * m_flown + path.dot(place - m_place);
    m_sent = keep * m_sent + path.dot(path);
  }
  m_has_place = true;
  m_place = place;
  m_time_s = time_s;
  DroneResponse ahead = m_response;
  const Eigen::Vector2d late = ahead.advance(time_s + m_response.options().delay).head<2>();
  m_rest = place + obeyed() * (late + ahead.coast().head<2>());
}

void PlaneResponse::send(const Eigen::Vector2d &velocity)
{
  m_response.send(m_time_s, {velocity.x(), velocity.y(), 0, 0});
}
} // namespace bole
