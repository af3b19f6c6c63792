// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How a small quadrotor moves: the body that vpSimulatorArDrone flies.
///
/// Idea: an AR.Drone's firmware takes tilts, a rate of climb and a rate of turn, and closes the fast loops itself. So
/// the body is what is left for a user to feel: a second-order attitude loop, thrust along z of the body, drag, lags in
/// climb and turn, limits, a command that comes late, gusts, and a hover of its own on the velocity of its floor
/// camera.
///
/// Frames: w world (z up), b body (x forward, y left, z up). SI.

#include "simulation/random.h"
#include <bole/pose.h>

#include <deque>

namespace bole
{
// Tilt and climb limits of the published settings of the AR.Drone; a share of 0.5 of the largest tilt gives 1.4 m/s^2,
// as measured on a real one (vpRobotArDrone::Options::gain).
constexpr double kLargestTilt = 0.28;  ///< [rad]
constexpr double kTiltFrequency = 10;  ///< natural frequency of the attitude loop [rad/s]
constexpr double kTiltDamping = 0.8;   ///< of the attitude loop
constexpr double kClimbLag = 0.35;     ///< time constant of the rate of climb [s]
constexpr double kTurnLag = 0.2;       ///< time constant of the rate of turn [s]
constexpr double kTakeOffHeight = 1.2; ///< over the place it stood [m]

struct QuadrotorOptions
{
  std::uint64_t seed = 1;
  double drag = 0.25;           ///< [1/s], 0 to 5
  double command_delay = 0.04;  ///< radio and firmware [s], 0 to 1
  double hover_gain = 1.5;      ///< braking of the drone's own hover [1/s], 0 to 10
  double gust = 0.05;           ///< standard deviation of the wind's push, horizontal axis [m/s^2], 0 to 5: calm
  double gust_time = 1;         ///< its correlation time [s], 0.05 to 60
  double velocity_noise = 0.03; ///< of the velocity that it measures itself, an axis [m/s], 0 to 1

  /// Throws vpException "name = value, must be ...".
  void validate() const;
};

/// What the firmware is told.
struct QuadrotorCommand
{
  bool is_flying = false;                         ///< false: on the ground, or going there
  bool is_hovering = true;                        ///< the firmware holds the place; the rest is ignored
  Eigen::Vector2d tilt = Eigen::Vector2d::Zero(); ///< shares of the largest tilt that push forward and left, -1 to 1
  double climb = 0;                               ///< [m/s]
  double turn = 0;                                ///< [rad/s]
};

/// Laws (each a test): tilted for long, the speed is g tan(tilt) / drag; the tilt never exceeds its limit by more than
/// the overshoot of its damping; hovering, it comes to rest and keeps its height; the same seed gives the same flight.
class Quadrotor
{
public:
  /// Stands at \p xy on ground of the height \p ground, x of the body along \p heading.
  Quadrotor(const QuadrotorOptions &options, const Eigen::Vector2d &xy, double heading, double ground);

  /// Takes effect command_delay later.
  void command(const QuadrotorCommand &command);
  /// \p dt [s], 0 to 0.02.
  void step(double dt);

  double time() const { return m_time; }
  Pose pose() const;                                                     ///< wMb
  const Eigen::Vector3d &velocity() const { return m_velocity; }         ///< world
  const Eigen::Vector3d &acceleration() const { return m_acceleration; } ///< world, without gravity
  /// Horizontal velocity in the body's heading (x forward, y left) as the floor camera measures it.
  Eigen::Vector2d measuredVelocity() const;
  double tilt() const; ///< of the body's z against the vertical [rad]
  bool isInAir() const { return m_is_in_air; }

private:
  void stand();
  Eigen::Vector2d wantedTilt(const QuadrotorCommand &command) const;
  double wantedClimb(const QuadrotorCommand &command);
  void blow(double dt);

  QuadrotorOptions m_options;
  Random m_random;
  std::deque<std::pair<double, QuadrotorCommand>> m_on_the_way; ///< by the time they arrive
  QuadrotorCommand m_command;
  double m_time = 0, m_ground, m_yaw, m_turn = 0, m_height_held = 0;
  Eigen::Vector3d m_position, m_velocity = Eigen::Vector3d::Zero(), m_acceleration = Eigen::Vector3d::Zero();
  Eigen::Vector2d m_lean = Eigen::Vector2d::Zero();      ///< tilts that push forward and left [rad]
  Eigen::Vector2d m_lean_rate = Eigen::Vector2d::Zero(); ///< [rad/s]
  Eigen::Vector2d m_gust = Eigen::Vector2d::Zero(), m_velocity_error = Eigen::Vector2d::Zero();
  bool m_is_in_air = false, m_is_rising = false, m_holds_height = false;
};
} // namespace bole
