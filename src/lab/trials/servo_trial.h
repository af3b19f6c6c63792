// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A servoing task from one random start, and what came of it.
#include "simulation/forest.h"
#include "trials/closed_loop.h"
#include <bole/evaluation.h>
#include <bole/options.h>

namespace bole
{
// Random starts for the servoing tasks: a forest, a place to take off, and what is asked for.

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
  int target = -1;           ///< id of the trunk meant (hold, circle)
  int left = -1, right = -1; ///< ids of the gap's trunks
  double gap_width = 0;      ///< bark to bark at flight height [m]

  /// Ids of the trunks without which the task is none.
  std::vector<int> askedFor() const;
};
Scenario makeScenario(const ScenarioOptions &options);

struct ServoTrialOptions
{
  ScenarioOptions scenario; ///< with the task and the seed
  double distance = 3;      ///< hold [m], 0.5 to 20
  double ratio = 0;         ///< hold, circle: r/d; 0: hold by distance, circle 0.07
  double speed = 0;         ///< circle, gap, slalom [m/s]; 0: 0.5, 0.6, 1.2
  PerceptionKind perception = PerceptionKind::real;
  double missing = 0;                   ///< by truth: share of the trunks not asked for that the map never has, 0 to 1
  Options pipeline = defaultPipeline(); ///< of real perception
  LoopOptions loop;
  vpSimulatorArDrone::Options robot = defaultRobot(); ///< start, heading and seeds are set by the scenario

  /// vpSimulatorArDrone's defaults with a stiffer velocity loop (gain 0.6) and 2 samples a pixel.
  static vpSimulatorArDrone::Options defaultRobot();
  /// The defaults for a camera that is steered by the trunks, with poses older than 15 s marginalised: what it sees
  /// from one place would make each frame more costly than the last.
  static Options defaultPipeline();
};

/// What came of it. Figures that a task does not have are NaN.
struct ServoTrialResult
{
  std::uint64_t seed = 0;
  bool is_success = false;
  std::string outcome;                   ///< one line: why not, where it failed
  double servoing_from_s = kNotMeasured; ///< NaN where the task never found what it flies by
  double duration_s = 0;
  double bearing_rms_deg = kNotMeasured; ///< hold, circle: true errors over the last 5 s
  double distance_rms = kNotMeasured;    ///< the same, relative
  double distance_mean = kNotMeasured;   ///< the same: what does not average out
  double ratio_rms = kNotMeasured;       ///< of r/d against the one asked for: the image's share of distance_rms
  double turned_deg = kNotMeasured;      ///< circle: how far round
  double least_clearance = kNotMeasured; ///< body's origin to bark [m]
  double gap_width = kNotMeasured;       ///< gap: true free width of the one passed [m]
  bool is_other_gap = false;             ///< gap: not the one that the scenario has set up
  double progress = kNotMeasured;        ///< slalom [m]
  double mean_speed = kNotMeasured;      ///< slalom: of its path, from leaving to arriving [m/s]
  double speed_along = kNotMeasured;     ///< the same: of its progress along the line [m/s]
  double median_loop_ms = kNotMeasured, p95_loop_ms = kNotMeasured;
  double hover_after_s = kNotMeasured; ///< fault: until it hovered [s]
  double drift = kNotMeasured;         ///< fault: how far it moved while it lasted [m]
  LoopRecord record;
  std::vector<SimulatedTrunk> trunks; ///< it flew among
};

/// Flies it. Success: hold and circle: right trunk, rms of the true bearing within 0.5 degrees and of the distance
/// within 3 % over the last 5 s (circle: once round too); gap: through one that is wide enough; slalom: to the end of
/// the line; all without touching a trunk.
ServoTrialResult runServoTrial(const ServoTrialOptions &options, const LoopWatcher &watcher = {});
} // namespace bole
