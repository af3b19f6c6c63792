// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Flights whose pose is known at every instant.

#include "simulation/forest.h"
#include <bole/pose.h>

#include <vector>

namespace bole
{
enum class PathKind
{
  forward, ///< ahead, weaving 1.2 m
  lateral, ///< sideways sweeps of 1.8 m, slow advance
  loop,    ///< a circle that closes, heading along it
  slalom   ///< round gate trunks left and right, heading along the path
};

struct FlightOptions
{
  PathKind kind = PathKind::forward;
  std::uint64_t seed = 1;
  double speed = 1;        ///< along the path [m/s], 0.05 to 10
  double duration = 12;    ///< [s], 0 to 3600
  double laps = 1;         ///< of a loop, in the time there is, 0.1 to 1000
  double height = 1.2;     ///< over the ground at the start [m], 0.3 to 10
  double wobble_deg = 1.2; ///< of roll and pitch on top of what the acceleration asks for, 0 to 20
};

/// The true motion of the drone: position analytic in time; roll and pitch as a quadrotor needs
/// them for its acceleration (thrust along z of the body), plus a wobble.
///
/// Laws (each a test): the path is continuous in position and attitude; the z axis of the body is
/// parallel to acceleration minus gravity when the wobble is zero; a loop ends where it began.
class FlightPath
{
public:
  explicit FlightPath(const FlightOptions &options);

  Eigen::Vector3d position(double t) const;
  double heading(double t) const;               ///< yaw [rad]
  Eigen::Vector3d acceleration(double t) const; ///< world, without gravity
  Pose bodyPose(double t) const;                ///< wMb
  Eigen::Vector3d bodyRate(double t) const;     ///< angular rate in the body frame [rad/s]

  /// Points of the path, 10 cm apart or less: where nothing may grow.
  std::vector<Eigen::Vector3d> waypoints() const;
  /// Trunks that belong to the path: the gates of the slalom; empty for the others.
  std::vector<SimulatedTrunk> gates() const;
  const FlightOptions &options() const { return m_options; }

private:
  FlightOptions m_options;
  double m_phase[6];
  double m_swing = 1, m_wave_length = 8, m_radius = 6;
};
} // namespace bole
