// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/quadrotor.h"

#include "support/text.h"
#include "support/units.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kStanding = 0.05;    ///< height of the body's origin when it stands [m]
constexpr double kLandingSpeed = 0.4; ///< [m/s]
constexpr double kHeightGain = 1.5;   ///< of the held height [1/s]
constexpr double kLargestClimb = 1.5; ///< what the motors can [m/s]
constexpr double kNoiseTime = 0.3;    ///< correlation time of the error of the measured velocity [s]

Eigen::Vector2d noise(Random &random, double sigma)
{
  const double x = random.normal(), y = random.normal();
  return {sigma * x, sigma * y};
}

/// One step of a process with the standard deviation \p sigma and the correlation time \p tau.
void wander(Eigen::Vector2d &value, Random &random, double sigma, double tau, double dt)
{
  const double keep = std::exp(-dt / tau);
  value = keep * value + noise(random, sigma * std::sqrt(1 - keep * keep));
}
} // namespace

void QuadrotorOptions::validate() const
{
  requireRange("drag", drag, 0, 5);
  requireRange("command_delay", command_delay, 0, 1);
  requireRange("hover_gain", hover_gain, 0, 10);
  requireRange("gust", gust, 0, 5);
  requireRange("gust_time", gust_time, 0.05, 60);
  requireRange("velocity_noise", velocity_noise, 0, 1);
}

Quadrotor::Quadrotor(const QuadrotorOptions &options, const Eigen::Vector2d &xy, double heading, double ground)
    : m_options(options),
      m_random(options.seed, 501),
      m_ground(ground),
      m_yaw(heading),
      m_position(xy.x(), xy.y(), ground + kStanding)
{
  options.validate();
}

void Quadrotor::command(const QuadrotorCommand &command)
{
  m_on_the_way.emplace_back(m_time + m_options.command_delay, command);
}

Pose Quadrotor::pose() const
{
  const Eigen::Matrix3d R =
      (Eigen::AngleAxisd(m_yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(m_lean.x(), Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(-m_lean.y(), Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return {R, m_position};
}

Eigen::Vector2d Quadrotor::measuredVelocity() const
{
  return Eigen::Rotation2Dd(-m_yaw) * m_velocity.head<2>() + m_velocity_error;
}

double Quadrotor::tilt() const { return std::acos(std::clamp(pose().R(2, 2), -1.0, 1.0)); }

Eigen::Vector2d Quadrotor::wantedTilt(const QuadrotorCommand &command) const
{
  Eigen::Vector2d tilt = kLargestTilt * command.tilt.cwiseMax(-1).cwiseMin(1);
  if (command.is_hovering || m_is_rising || !command.is_flying)
    tilt = -m_options.hover_gain / kGravity * measuredVelocity();
  const double size = tilt.norm();
  return size > kLargestTilt ? Eigen::Vector2d(tilt * (kLargestTilt / size)) : tilt;
}

/// The height is held where no climb is asked for.
double Quadrotor::wantedClimb(const QuadrotorCommand &command)
{
  if (!command.is_flying)
    return -kLandingSpeed;
  const bool holds = m_is_rising || command.is_hovering || std::abs(command.climb) < 1e-3;
  if (!holds) {
    m_holds_height = false;
    return std::clamp(command.climb, -kLargestClimb, kLargestClimb);
  }
  if (!m_holds_height)
    m_height_held = m_position.z();
  m_holds_height = true;
  if (m_is_rising && std::abs(m_position.z() - m_height_held) < 0.05)
    m_is_rising = false;
  return std::clamp(kHeightGain * (m_height_held - m_position.z()), -0.7, 0.7);
}

void Quadrotor::blow(double dt)
{
  wander(m_gust, m_random, m_options.gust, m_options.gust_time, dt);
  wander(m_velocity_error, m_random, m_options.velocity_noise, kNoiseTime, dt);
}

void Quadrotor::stand()
{
  m_velocity.setZero();
  m_acceleration.setZero();
  m_lean.setZero();
  m_lean_rate.setZero();
  m_turn = 0;
  m_position.z() = m_ground + kStanding;
  m_is_in_air = false;
}

void Quadrotor::step(double dt)
{
  m_time += dt;
  while (!m_on_the_way.empty() && m_on_the_way.front().first <= m_time) {
    m_command = m_on_the_way.front().second;
    m_on_the_way.pop_front();
  }
  blow(dt);
  if (!m_is_in_air) {
    if (!m_command.is_flying)
      return;
    m_is_in_air = m_is_rising = m_holds_height = true;
    m_height_held = m_ground + kTakeOffHeight;
  }
  constexpr double w = kTiltFrequency;
  m_lean_rate += dt * (w * w * (wantedTilt(m_command) - m_lean) - 2 * kTiltDamping * w * m_lean_rate);
  m_lean += dt * m_lean_rate;
  const bool turns = m_command.is_flying && !m_command.is_hovering && !m_is_rising;
  m_turn += dt / kTurnLag * ((turns ? m_command.turn : 0) - m_turn);
  m_yaw += dt * m_turn;

  const Eigen::Vector3d up = pose().R.col(2);
  const double climbing = (wantedClimb(m_command) - m_velocity.z()) / kClimbLag;
  m_acceleration.head<2>() =
      (kGravity + climbing) / up.z() * up.head<2>() - m_options.drag * m_velocity.head<2>() + m_gust;
  m_acceleration.z() = climbing;
  m_velocity += dt * m_acceleration;
  m_position += dt * m_velocity;
  if (!m_command.is_flying && m_position.z() <= m_ground + kStanding)
    stand();
}
} // namespace bole
