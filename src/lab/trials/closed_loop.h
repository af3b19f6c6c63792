// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One flight of a task in the simulated forest: camera, tracker, task, drone; and its record.
///
/// Idea: the task gets what the perception makes of a frame and nothing else. The truth goes into the record only,
/// through a judge that is asked after the command has been given.
#include "faults/fault.h"
#include "simulation/forest.h"
#include "simulation/vpSimulatorArDrone.h"
#include "tasks/servo_task.h"
#include "trials/perception.h"

#include <functional>
#include <optional>
#include <string>

namespace bole
{
/// What was true and what was done at one frame.
struct LoopSample
{
  double time_s = 0; ///< of the frame, from take-off
  TaskPhase phase = TaskPhase::searching;
  bool is_lost = false, is_hovering = false, is_spoilt = false;
  FrameStatus frame_status = FrameStatus::ok;
  Pose truth, estimate;                              ///< wMb at the frame
  Eigen::Vector4d command = Eigen::Vector4d::Zero(); ///< of the body
  double speed = 0;                                  ///< true, horizontal [m/s]
  double clearance = 0;                              ///< true, body's origin to bark [m]
  double loop_ms = 0;                                ///< of processor time: perception and task
  ServoTask::Values believed, real;                  ///< errors by the task, by the truth
  std::vector<KnownTrunk> map;                       ///< as believed, near the drone
  std::string reason;
};

struct LoopOptions
{
  double duration_s = 40;    ///< of servoing, at most, 1 to 3600
  double search_most_s = 60; ///< before it, at most, 1 to 3600
  FaultOptions fault;

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

struct LoopRecord
{
  std::vector<LoopSample> samples;
  double servoing_from_s = -1;         ///< first time the task servoed, -1: never
  bool is_contact = false;             ///< touched a trunk
  bool is_finished = false;            ///< the task said done
  std::vector<SensorVerdict> verdicts; ///< on sensors that contradicted the others

  double loopQuantile_ms(double share) const;
};

/// The truth about a task's errors: \p truth of the body at the frame and what the perception knows after it. The task
/// is asked for what it chose, not told anything.
using Judge = std::function<ServoTask::Values(const Pose &truth, const FrameReport &report)>;
/// Called after each frame; false ends the flight.
using LoopWatcher = std::function<bool(const Frame &, const FrameReport &, const LoopSample &)>;

/// Takes off and flies. \p robot stands on the ground.
LoopRecord runClosedLoop(vpSimulatorArDrone &robot, const Perception &perception, ServoTask &task,
                         const LoopOptions &options, const Judge &judge = {}, const LoopWatcher &watcher = {});

// A closed-loop flight as tables: what was done, and why it failed. `apps/campaign/figures.py` draws them.

/// A row a frame: time, phase, status, true and estimated place, command, speed, clearance, loop time, errors.
std::string samplesCsv(const LoopRecord &record);

/// The first of half a second of frames in which something the task flies by was wrong.
struct Parting
{
  std::size_t sample = 0;
  std::string what; ///< one line
};

/// Asked in this order, of each frame: an error of the task that it believes otherwise than it is (by half a degree, 3
/// per cent, or .3 of any other unit); within 4 m a confirmed trunk where none stands within .6 m, or one that is .3 m
/// off; within 2 m and 35 degrees of straight ahead a trunk that the map does not hold. None: belief was right, what
/// failed is control.
std::optional<Parting> findParting(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks);

/// Why a flight failed, as JSON: the outcome, the parting, and at the parting and at the end the drone, the trunks as
/// they are and as they are believed (moved to where the drone truly was).
std::string failureJson(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks, const std::string &title,
                        const std::optional<Parting> &parting);
} // namespace bole
