// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/simulated_flight.h"

#include "support/units.h"

#include "simulation/random.h"
#include <bole/pose.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kTwoPi = 2 * M_PI;
} // namespace

FlightPath::FlightPath(const FlightOptions &options) : m_options(options)
{
  Random random(options.seed, 301);
  for (double &phase : m_phase)
    phase = random.uniform(0, kTwoPi);
  switch (options.kind) {
  case PathKind::forward:
    m_swing = random.uniform(0.9, 1.3);
    m_wave_length = random.uniform(7, 10);
    break;
  case PathKind::lateral:
    m_swing = random.uniform(1.5, 2);
    m_wave_length = random.uniform(7.5, 9.5); // seconds a sweep, to and fro, at 1 m/s
    break;
  case PathKind::loop:
    // If its radius is one that a clearing in a forest has.
    m_radius = std::clamp(options.speed * options.duration / options.laps / kTwoPi, 3.0, 15.0);
    break;
  case PathKind::slalom:
    m_swing = random.uniform(1.6, 2.2);
    m_wave_length = random.uniform(8, 10);
    break;
  }
}

Eigen::Vector3d FlightPath::position(double t) const
{
  const double along = m_options.speed * t;
  const double z = m_options.height + 0.1 * std::sin(0.7 * t + m_phase[0]) + 0.06 * std::sin(1.9 * t + m_phase[1]);
  switch (m_options.kind) {
  case PathKind::forward:
    return {along, m_swing * std::sin(kTwoPi * along / m_wave_length + m_phase[2]), z};
  case PathKind::lateral:
    return {0.35 * along + 0.1 * std::sin(0.9 * t + m_phase[3]),
            m_swing * std::sin(kTwoPi * along / m_wave_length + m_phase[2]), z};
  case PathKind::loop: {
    const double angle = along / m_radius;
    return {m_radius * std::sin(angle), m_radius * (1 - std::cos(angle)), z};
  }
  case PathKind::slalom:
    return {along, m_swing * std::sin(kTwoPi * along / m_wave_length), z};
  }
  return {0, 0, z};
}

double FlightPath::heading(double t) const
{
  const double sway = 0.04 * std::sin(0.8 * t + m_phase[4]);
  const double along = m_options.speed * t;
  switch (m_options.kind) {
  case PathKind::lateral:
    return sway;
  case PathKind::loop:
    return along / m_radius + 0.1 + sway;
  default:
    break;
  }
  const Eigen::Vector3d step = position(t + 0.01) - position(t - 0.01);
  const double tangent = std::atan2(step.y(), step.x());
  return sway + (m_options.kind == PathKind::slalom ? 0.8 : 0.3) * tangent;
}

Eigen::Vector3d FlightPath::acceleration(double t) const
{
  constexpr double h = 1e-3;
  return (position(t + h) - 2 * position(t) + position(t - h)) / (h * h);
}

Pose FlightPath::bodyPose(double t) const
{
  // Thrust is along z of the body, so z points along acceleration minus gravity; x towards the heading.
  const Eigen::Vector3d up = (acceleration(t) + Eigen::Vector3d(0, 0, kGravity)).normalized();
  const double yaw = heading(t);
  const Eigen::Vector3d left = up.cross(Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0)).normalized();
  Eigen::Matrix3d R;
  R << left.cross(up), left, up;
  const double wobble = m_options.wobble_deg * M_PI / 180;
  const Eigen::Vector3d shake(wobble * (0.8 * std::sin(2.6 * t + m_phase[5]) + 0.4 * std::sin(9 * t + m_phase[1])),
                              wobble * (0.8 * std::sin(2.1 * t + m_phase[2]) + 0.4 * std::sin(8 * t + m_phase[3])), 0);
  return {R * expSo3(shake), position(t)};
}

Eigen::Vector3d FlightPath::bodyRate(double t) const
{
  constexpr double h = 1e-3;
  return logSo3(bodyPose(t - h).R.transpose() * bodyPose(t + h).R) / (2 * h);
}

std::vector<Eigen::Vector3d> FlightPath::waypoints() const
{
  const double step = 0.05 / std::max(0.2, m_options.speed);
  std::vector<Eigen::Vector3d> points;
  for (double t = 0; t < m_options.duration + step; t += step)
    points.push_back(position(std::min(t, m_options.duration)));
  return points;
}

std::vector<SimulatedTrunk> FlightPath::gates() const
{
  std::vector<SimulatedTrunk> trunks;
  if (m_options.kind != PathKind::slalom)
    return trunks;
  Random random(m_options.seed, 302);
  const double length = m_options.speed * m_options.duration + 6;
  for (double x = 0.25 * m_wave_length, side = 1; x < length; x += 0.5 * m_wave_length, side = -side) {
    SimulatedTrunk trunk; // inside the bend, 1.2 to 1.7 m from the path
    trunk.radius = random.uniform(0.1, 0.25);
    trunk.foot = {x, side * (m_swing - random.uniform(1.2, 1.7)), 0};
    trunk.lean = {0.02 * random.normal(), 0.02 * random.normal()};
    trunk.shade = random.uniform(0.8, 1.2);
    trunk.crown_base = random.uniform(4, 7);
    trunks.push_back(trunk);
  }
  return trunks;
}
} // namespace bole
