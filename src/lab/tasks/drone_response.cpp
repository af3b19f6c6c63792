// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/drone_response.h"

#include <algorithm>
#include <cmath>

namespace bole
{
/// Of one of its lags: two for a velocity, one for the turn.
double DroneResponse::lagOf(int axis) const { return axis == 3 ? m_options.turn_lag : 0.5 * m_options.speed_lag; }

Eigen::Vector4d DroneResponse::coast() const
{
  Eigen::Vector4d path = m_options.turn_lag * m_velocity;
  path.head<3>() = lagOf(0) * (m_velocity + m_push).head<3>();
  return path;
}

DroneResponse::DroneResponse(const ResponseOptions &options) : m_options(options) {}

void DroneResponse::send(double frame_time_s, const Eigen::Vector4d &velocity)
{
  m_sent.emplace_back(frame_time_s + m_options.delay, velocity);
}

Eigen::Vector4d DroneResponse::advance(double time_s)
{
  Eigen::Vector4d path = Eigen::Vector4d::Zero();
  if (!m_has_time)
    m_time_s = time_s;
  m_has_time = true;
  while (m_time_s < time_s) {
    while (m_sent.size() > 1 && m_sent[1].first <= m_time_s)
      m_sent.pop_front();
    const bool acts = !m_sent.empty() && m_sent.front().first <= m_time_s;
    const Eigen::Vector4d wanted = acts ? m_sent.front().second : Eigen::Vector4d::Zero();
    double until = time_s;
    if (m_sent.size() > (acts ? 1u : 0u))
      until = std::min(until, m_sent[acts ? 1 : 0].first);
    const double dt = until - m_time_s;
    for (int axis = 0; axis < 4; ++axis) {
      const double lag = lagOf(axis), keep = lag > 0 ? std::exp(-dt / lag) : 0;
      const double ahead = m_velocity(axis) - wanted(axis), push = axis == 3 ? 0 : m_push(axis) - wanted(axis);
      path(axis) += wanted(axis) * dt + (ahead + push) * lag * (1 - keep) - push * dt * keep;
      m_velocity(axis) = wanted(axis) + (ahead + (lag > 0 ? push * dt / lag : 0)) * keep;
      m_push(axis) = wanted(axis) + push * keep;
    }
    m_time_s = until;
  }
  return path;
}
} // namespace bole
