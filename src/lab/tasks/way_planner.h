// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The quickest way that is safe by what is known, and how fast it may be flown.
///
/// Idea: every place has a speed: what lets a drone that leaves its way at a slant stop before the nearest surface that
/// may exist (uncertainty of its place included), or, where nobody has seen what is there, what may be risked blindly.
/// The quickest way over this field of speeds, from the goal backwards (Dijkstra on a grid), keeps away from what is
/// near or unknown as far as the detour is worth the time, and so needs no weights between clearance, length and speed.
/// What is flown is a point ahead on the way, at a speed from which the drone can slow down to that of every place
/// ahead: v <= v(s) + s / T.
///
/// Coordinates are those of the task: x ahead, y left [m].

#include "tasks/obstacles.h"

#include <functional>

namespace bole
{
/// Lengths in metres.
struct WayOptions
{
  double speed = 1;      ///< largest [m/s], 0.05 to 3
  double hull = 0.28;    ///< radius of the drone, 0.05 to 2
  double free = 0.15;    ///< between hull and bark that it plans to keep: what it errs from its way, 0 to 2
  double stopping_s = 1; ///< way to stop over the speed [s]: lags of video, radio, tilt and velocity, 0.1 to 5
  double sigmas = 1.5;   ///< of a surface's place that count as surface, 0 to 5

  /// Where hull and free were not seen to be free: what lets it stop within free [m/s].
  double unseenSpeed() const { return free / stopping_s; }
};

/// What is asked for. Functions get places on the task's axes.
struct WayGoal
{
  double x_end = 0;             ///< the way ends where x is reached [m]
  double y_low = 0, y_high = 0; ///< the field is as wide [m]
  /// Cost of a second spent at the place, in seconds, 0 or more: it grows with the distance from a line.
  std::function<double(double x, double y)> detour = {};
  std::function<bool(double x, double y)> is_wall = {}; ///< never crossed: what is beside a gap
};

/// How far round the place x ahead, y left [m] all was seen to be free [m].
using RoomAt = std::function<double(double x, double y)>;

struct Way
{
  bool is_open = false;                ///< leads to the goal
  std::vector<Eigen::Vector2d> places; ///< a grid's step apart, from the drone on; empty where there is none
  double speed = 0;                    ///< to fly now [m/s]
  Eigen::Vector2d ahead = Eigen::Vector2d::UnitX(); ///< unit vector to fly along now
  double clearance = 0; ///< least over the next metres, hull to surface, uncertainty counted [m]

  /// From \p from to the place \p range [m] on along it.
  Eigen::Vector2d lookedAt(const Eigen::Vector2d &from, double range) const;
};

/// \p last: the way before, which is kept where another is hardly quicker; none: empty.
Way planWay(const std::vector<Obstacle> &surfaces, const Eigen::Vector2d &from, const WayGoal &goal,
            const WayOptions &options, const Way &last, const RoomAt &room_at = {});
} // namespace bole
