// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/gap_and_slalom.h"

#include "support/units.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kAhead = 7;       ///< as far as ways are planned [m]
constexpr double kSwingOn = 0.6;   ///< the swing goes on as if flying at [m/s], at the least
constexpr double kLookAside = 0.6; ///< amplitude of the sidestep before it leaves [m]
constexpr double kLookAt = 2;      ///< the camera looks at the way so far ahead [m]
constexpr double kLargestLook = 1; ///< from the line [rad]
constexpr int kCandidateViews = 5; ///< a candidate seen this often is avoided too
} // namespace

SlalomTask::SlalomTask(const SlalomTaskOptions &options)
    : ServoTask({}, options.response), m_options(options), m_sidestep(kLookAside, std::max(options.look, 1e-3))
{
}

ServoTask::Values SlalomTask::errors() const
{
  return {{"along [m]", m_place.x()},
          {"across [m]", m_place.y()},
          {"clearance by the map [m]", std::min(m_way.clearance, 9.0)}};
}

double SlalomTask::line(double x) const
{
  return m_options.swing * std::sin(2 * M_PI * (x + m_lead) / m_options.wave_length);
}

void SlalomTask::locate(const FrameReport &report)
{
  const double time_s = secondsOf(report.stamp_ns);
  if (!m_started) {
    m_start = {Eigen::AngleAxisd(yawOf(report.wMb), Eigen::Vector3d::UnitZ()).toRotationMatrix(), report.wMb.t};
    m_started = true;
    m_time_s = time_s;
  }
  const Eigen::Vector2d place = (m_start.inverse() * report.wMb.t).head<2>();
  m_lead += std::max(0.0, kSwingOn * (time_s - m_time_s) - (place.x() - m_place.x()));
  m_place = place;
  m_time_s = time_s;
}

TaskCommand SlalomTask::act(const FrameReport &report)
{
  locate(report);
  if (phase() == TaskPhase::searching && m_sidestep.elapsed(m_time_s) < m_options.look) {
    m_lead = 0;
    return {false, m_sidestep.velocity(report.wMb, m_time_s), "looks before it leaves"};
  }
  enter(m_place.x() >= m_options.length ? TaskPhase::done : TaskPhase::servoing);
  if (phase() == TaskPhase::done)
    return {true, Eigen::Vector4d::Zero(), "arrived"};
  const Eigen::Matrix2d axes = m_start.R.topLeftCorner<2, 2>().transpose();
  std::vector<Obstacle> surfaces = around().surfaces(report, kAhead + m_options.reach, kCandidateViews);
  for (Obstacle &surface : surfaces) {
    surface.xy = axes * (surface.xy - m_start.t.head<2>());
    surface.covariance = axes * surface.covariance * axes.transpose();
  }
  const auto room_at = [&](double x, double y) {
    return around().roomAt(m_start.t.head<2>() + axes.transpose() * Eigen::Vector2d(x, y));
  };
  WayGoal goal;
  goal.x_end = m_place.x() + kAhead;
  goal.y_high = std::max(m_options.reach, std::abs(m_place.y()) + 1);
  goal.y_low = -goal.y_high;
  goal.detour = [this](double x, double y) { return m_options.off_line * std::abs(y - line(x)); };
  m_way = planWay(surfaces, axes * (response().rest() - m_start.t.head<2>()), goal, m_options.way, m_way, room_at);
  const Eigen::Vector2d velocity = m_way.speed / response().obeyed() * m_way.ahead;
  const Eigen::Vector2d look = m_way.lookedAt(m_place, kLookAt);
  const double turned = std::clamp(std::atan2(look.y(), look.x()), -kLargestLook, kLargestLook);
  return {false, towards(report.wMb, axes.transpose() * velocity, yawOf(m_start) + turned),
          m_way.speed < 0.9 * m_options.way.speed ? "slows" : "flies"};
}
} // namespace bole
