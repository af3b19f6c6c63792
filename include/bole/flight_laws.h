// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What no command may make a drone do: the laws that vpRobotArDrone and the simulated drone keep.
///
/// Idea: the laws stand in the robot's own loop, behind whoever sends velocities, and need nothing but the drone's own
/// sensors and a clock. A velocity towards a limit is cut to what is left of the way to it when the drone has coasted
/// to rest; what leads away from a limit is never cut.

#include <Eigen/Core>

#include <optional>

namespace bole
{
/// The limits that the laws keep.
struct FlightLawOptions
{
  double hover_after_s = 0.5; ///< without a new command, 0.05 to 2: five frames of a slow tracker
  double land_after_s = 3;    ///< without a new command, or without navdata, to 60, more than hover_after_s
  double fence = 100;         ///< from the place of take-off, horizontally [m], 1 to 100000
  double lowest = 0.4;        ///< over the ground [m], 0 to 5: the sonar is blind below 0.3
  double highest = 4;         ///< over the ground [m], more than lowest, to 100
  double least_battery = 0.1; ///< share of full below which it lands, 0 to 1
  double coast_s = 0.6;       ///< way on which it comes to rest over its speed [s], 0.1 to 5: lags of radio and tilt

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// By the drone's own sensors.
struct OwnState
{
  Eigen::Vector2d place = Eigen::Vector2d::Zero();    ///< [m], any axes that do not turn
  double yaw = 0;                                     ///< in these [rad]
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero(); ///< of the body [m/s]
  double height = 0;                                  ///< over the ground [m], 0 while the sonar is blind
  double battery = 1;                                 ///< share of full
};

/// What the laws make of a command.
struct FlightOrder
{
  /// What the drone does.
  enum class Kind
  {
    flies, ///< at `velocity`
    hovers,
    lands
  };
  Kind kind = Kind::hovers;                           ///< what the drone does
  Eigen::Vector4d velocity = Eigen::Vector4d::Zero(); ///< vx, vy, vz [m/s], wz [rad/s] of the body
  const char *law = "";                               ///< that overrules what was wanted; empty where none does
};

/// Laws (each a test): it hovers, then lands, without commands; it hovers, then lands, without navdata; it lands by a
/// low battery; it stops before the fence and comes back from beyond; it keeps to the band of heights.
class FlightLaws
{
public:
  /// \throw vpException where an option is out of its range.
  explicit FlightLaws(const FlightLawOptions &options = {});

  void takeOff(double time_s);                        ///< the fence stands round the next place told
  void renew(double time_s) { m_renewed_s = time_s; } ///< a command has come (a hover too)
  /// \p wanted: none, to hover; \p own: none while there is no navdata. Times rise [s].
  FlightOrder apply(double time_s, const std::optional<Eigen::Vector4d> &wanted, const std::optional<OwnState> &own);

private:
  Eigen::Vector4d limited(const Eigen::Vector4d &wanted, const OwnState &own, const char *&law) const;

  FlightLawOptions m_options;
  double m_renewed_s = 0, m_told_s = 0; ///< last command, last navdata
  std::optional<Eigen::Vector2d> m_home;
};
} // namespace bole
