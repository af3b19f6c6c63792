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

void FeatureFilter::start(double seen, double sigma, double drift_sigma)
{
  m_x << seen, 0;
  m_P = Eigen::Vector2d(sigma * sigma, drift_sigma * drift_sigma).asDiagonal();
}

void FeatureFilter::predict(double moved, double dt, double unrest)
{
  Eigen::Matrix2d F;
  F << 1, dt, 0, 1;
  Eigen::Matrix2d Q; // a drift that walks at random, integrated over dt
  Q << dt * dt * dt / 3, dt * dt / 2, dt * dt / 2, dt;
  m_x = F * m_x + Eigen::Vector2d(moved, 0);
  m_P = F * m_P * F.transpose() + unrest * unrest * Q;
}

void FeatureFilter::correct(double seen, double sigma)
{
  constexpr double kBelieved = 3; // standard deviations; what is farther off counts as no more
  const double variance = m_P(0, 0) + sigma * sigma, most = kBelieved * std::sqrt(variance);
  const Eigen::Vector2d gain = m_P.col(0) / variance;
  m_x += gain * std::clamp(seen - m_x(0), -most, most);
  m_P -= gain * m_P.row(0);
}

void FeatureFilter::correctDrift(double seen, double sigma)
{
  const Eigen::Vector2d gain = m_P.col(1) / (m_P(1, 1) + sigma * sigma);
  m_x += gain * (seen - m_x(1));
  m_P -= gain * m_P.row(1);
}
} // namespace bole
