// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A flying task closed over the tracker: from what the pipeline knows after a frame to a velocity of the drone.
///
/// Idea: a task sees only the report of a frame, never a robot, so the same task flies vpRobotArDrone and
/// vpSimulatorArDrone. What every task shares is when *not* to act: step() commands a hover at once where a frame is
/// not ok, and where what the task hangs on was not found for lost_frames; it goes on after sure_frames in which it
/// was, and looks for another after patience_frames in which it was not; and what no velocity may do near that which is
/// believed or was not seen (safeVelocity). A drone that hovers holds its place by its
/// floor camera and its height by its sonar, without this one.
///
/// Frames: velocities are those of the body (x forward, y left, z up): vpRobot::REFERENCE_FRAME of both drones.

#include "support/units.h"
#include "tasks/drone_response.h"
#include "tasks/obstacles.h"
#include <bole/report.h>

#include <string>
#include <utility>
#include <vector>

namespace bole
{
enum class TaskPhase
{
  searching, ///< moves for parallax until the map holds what the task needs
  servoing,
  done,  ///< reached its end; hovers
  failed ///< gave up; hovers
};
const char *toString(TaskPhase phase);

struct TaskCommand
{
  bool is_hovering = true;
  Eigen::Vector4d velocity = Eigen::Vector4d::Zero(); ///< vx, vy, vz [m/s], wz [rad/s] of the body
  std::string reason;                                 ///< one line for a person
};

/// Laws (each a test): a frame that is not ok gives a hover in the same step; so do lost_frames without the target;
/// a hover ends only after sure_frames in a row; an odometry that the other sensors contradict ends the task; no
/// command breaks the laws of safeVelocity().
class ServoTask
{
public:
  using Values = std::vector<std::pair<std::string, double>>;

  explicit ServoTask(const SafetyOptions &safety = {}, const ResponseOptions &response = {});
  virtual ~ServoTask() = default;

  TaskCommand step(const FrameReport &report);

  TaskPhase phase() const { return m_phase; }
  bool isLost() const { return m_is_lost; }
  /// What the task believes its errors to be, by name with the unit; empty while it searches.
  virtual Values errors() const { return {}; }

protected:
  /// Whether this (ok) frame shows what the task hangs on.
  virtual bool sees(const FrameReport &report) const = 0;
  /// What the task hangs on is gone for good: search anew.
  virtual void giveUpTarget() {}
  virtual TaskCommand act(const FrameReport &report) = 0;
  /// What of act()'s velocity is sent.
  virtual void sent(const Eigen::Vector4d &, const FrameReport &) {}
  const Surroundings &around() const { return m_around; }
  const PlaneResponse &response() const { return m_response; } ///< in the world's axes
  void enter(TaskPhase phase) { m_phase = phase; }

private:
  TaskCommand decide(const FrameReport &report);

  SafetyOptions m_safety;
  Surroundings m_around;
  PlaneResponse m_response;
  std::string m_failure; ///< of a sensor
  TaskPhase m_phase = TaskPhase::searching;
  bool m_is_lost = false;
  int m_seen = 0, m_unseen = 0;
  int m_missed = 0; ///< good frames in a row without it
};

/// Sidesteps about the place where it began, the heading kept: range needs parallax.
class Sidestep
{
public:
  /// \param amplitude [m]; \param period [s].
  Sidestep(double amplitude = 0.7, double period = 9) : m_amplitude(amplitude), m_period(period) {}
  /// Velocity of the body; the first call sets the place.
  Eigen::Vector4d velocity(const Pose &wMb, double time_s);
  double elapsed(double time_s) const { return m_started ? time_s - m_start_s : 0; }
  const Pose &start() const { return m_start; }
  void restart() { m_started = false; }
  void restart(double amplitude)
  {
    m_amplitude = amplitude;
    m_started = false;
  }

private:
  double m_amplitude, m_period, m_start_s = 0;
  bool m_started = false;
  Pose m_start;
};

/// Velocity of the body that is \p velocity [m/s] in the world and turns towards \p heading [rad].
Eigen::Vector4d towards(const Pose &wMb, const Eigen::Vector2d &velocity, double heading);
/// \p v with its length at most \p largest.
Eigen::Vector2d limited(const Eigen::Vector2d &v, double largest);
} // namespace bole
