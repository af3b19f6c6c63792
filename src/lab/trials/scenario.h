// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Random starts for the servoing tasks: a forest, a place to take off, and what is asked for.

#include "simulation/forest.h"

namespace bole
{
enum class ServoKind
{
  hold,   ///< keep bearing and distance to a trunk
  circle, ///< go round a trunk at constant r/d
  gap,    ///< pass between two trunks
  slalom  ///< through a stand along a line
};
const char *toString(ServoKind kind);

struct ScenarioOptions
{
  ServoKind kind = ServoKind::hold;
  std::uint64_t seed = 1; ///< same seed, same scenario
  double density = 0;     ///< trunks a m^2; 0: 0.03 for hold and circle, 0.04 for gap, 0.05 for slalom
  double ratio = 0.07;    ///< circle: r/d of the ring round the trunk that is kept clear, 0.01 to 0.5
  double length = 40;     ///< slalom [m], 1 to 1000

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// Light, bark and every tree differ from seed to seed.
///
/// hold, circle: a trunk of radius 0.1 to 0.25 m, 3 to 5.5 m ahead and up to 10 degrees aside; the ground between is
/// free. gap: two trunks with 1.3 to 2 m between their bark (1.2 m are asked for, and trunks lean), the middle 4 to 6 m
/// ahead and up to 10 degrees aside, the gap turned by up to 25 degrees. slalom: trunks at random, on the line too;
/// only the place of take-off is free.
struct Scenario
{
  Forest forest;
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  double heading = 0;        ///< [rad]
  int target = -1;           ///< id of the trunk meant (hold, circle)
  int left = -1, right = -1; ///< ids of the gap's trunks
  double gap_width = 0;      ///< bark to bark at flight height [m]

  /// Ids of the trunks without which the task is none.
  std::vector<int> askedFor() const;
};
Scenario makeScenario(const ScenarioOptions &options);
} // namespace bole
