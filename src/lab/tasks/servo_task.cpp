// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/servo_task.h"

#include "support/text.h"
#include "support/units.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kPlaceGain = 0.7;   ///< [1/s]
constexpr double kTurnGain = 1.0;    ///< [1/s]
constexpr double kLargestTurn = 0.6; ///< [rad/s]
constexpr double kGuarded = 4;       ///< surfaces farther are no danger yet [m]
} // namespace

const char *toString(TaskPhase phase) { return nameOf(phase, {"searching", "servoing", "done", "failed"}); }

ServoTask::ServoTask(const SafetyOptions &safety, const ResponseOptions &response)
    : m_safety(safety), m_response(response)
{
}

/// What the task wants, where it may want anything.
TaskCommand ServoTask::decide(const FrameReport &report)
{
  const bool is_ok = report.frame_status == FrameStatus::ok;
  const bool is_seen = is_ok && sees(report);
  if (is_ok)
    m_missed = is_seen ? 0 : m_missed + 1;
  if (m_missed > m_safety.patience_frames) {
    giveUpTarget();
    m_missed = 0;
  }
  m_seen = is_seen ? m_seen + 1 : 0;
  m_unseen = is_seen ? 0 : m_unseen + 1;
  if (!is_ok || m_unseen >= m_safety.lost_frames)
    m_is_lost = true;
  else if (m_seen >= m_safety.sure_frames)
    m_is_lost = false;
  TaskCommand hover;
  if (m_phase == TaskPhase::done || m_phase == TaskPhase::failed) {
    hover.reason = m_phase == TaskPhase::failed && !m_failure.empty() ? m_failure + ": hovers" : toString(m_phase);
    return hover;
  }
  if (m_is_lost) {
    const std::string why = report.reason.empty() ? "" : " (" + report.reason + ")";
    hover.reason = is_ok ? "lost: hovers" : std::string("frame ") + toString(report.frame_status) + why + ": hovers";
    return hover;
  }
  for (const SensorVerdict &verdict : report.verdicts)
    if (verdict.sensor == "odometry") { // what is near is placed by it, and so are steps aside
      enter(TaskPhase::failed);
      m_failure = verdict.text;
      hover.reason = m_failure + ": hovers";
      return hover;
    }
  m_around.see(report);
  return act(report);
}

TaskCommand ServoTask::step(const FrameReport &report)
{
  const Eigen::Rotation2Dd heading(yawOf(report.wMb));
  const Eigen::Vector2d place = report.wMb.t.head<2>();
  m_response.see(place, secondsOf(report.stamp_ns));
  TaskCommand command = decide(report);
  if (command.is_hovering) {
    m_response.send(Eigen::Vector2d::Zero());
    return command;
  }
  const Eigen::Vector2d safe =
      safeVelocity(heading * Eigen::Vector2d(command.velocity.head<2>()), place, m_response.rest(),
                   m_around.surfaces(report, kGuarded, 1), m_around, m_safety);
  m_response.send(safe);
  command.velocity.head<2>() = heading.inverse() * safe;
  sent(command.velocity, report);
  return command;
}

Eigen::Vector2d limited(const Eigen::Vector2d &v, double largest)
{
  const double size = v.norm();
  return size > largest ? Eigen::Vector2d(v * (largest / size)) : v;
}

Eigen::Vector4d towards(const Pose &wMb, const Eigen::Vector2d &velocity, double heading)
{
  const double yaw = yawOf(wMb);
  const Eigen::Vector2d body = Eigen::Rotation2Dd(-yaw) * velocity;
  const double turn = kTurnGain * std::remainder(heading - yaw, 2 * M_PI);
  return {body.x(), body.y(), 0, std::clamp(turn, -kLargestTurn, kLargestTurn)};
}

Eigen::Vector4d Sidestep::velocity(const Pose &wMb, double time_s)
{
  if (!m_started) {
    m_start = wMb;
    m_start_s = time_s;
    m_started = true;
  }
  const double heading = yawOf(m_start), w = 2 * M_PI / m_period, t = time_s - m_start_s;
  const Eigen::Vector2d left(-std::sin(heading), std::cos(heading));
  const Eigen::Vector2d place = m_start.t.head<2>() + m_amplitude * std::sin(w * t) * left;
  return towards(wMb, m_amplitude * w * std::cos(w * t) * left + kPlaceGain * (place - wMb.t.head<2>()), heading);
}
} // namespace bole
