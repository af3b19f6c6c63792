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
constexpr double kSweep_s = 9;        ///< one sidestep to and fro before a gap is chosen
constexpr double kSearchAgain = 0.35; ///< amplitude of the sidestep once it has left its start [m]
constexpr double kLeavesView = 2.5;   ///< nearer to the middle the trunks may leave the image on both sides [m]
constexpr double kStopsTurning = 1.2; ///< nearer the camera looks along the gap and not at its middle [m]
constexpr double kWall = 0.3;     ///< half as thick is what closes the sides of the gap [m]: more than a knight's step
constexpr double kStraight = 1.5; ///< the way is straight as far before and behind the middle [m]
constexpr int kViews = 8;         ///< of a candidate that counts as in the way

Eigen::Vector2d leftOf(const Eigen::Vector2d &v) { return {-v.y(), v.x()}; }

double distanceToSegment(const Eigen::Vector2d &p, const Eigen::Vector2d &a, const Eigen::Vector2d &b)
{
  const Eigen::Vector2d ab = b - a;
  const double t = std::clamp((p - a).dot(ab) / std::max(ab.squaredNorm(), 1e-12), 0.0, 1.0);
  return (a + t * ab - p).norm();
}

bool isLookedFor(const FrameReport &report, int id)
{
  return std::any_of(report.trunks.begin(), report.trunks.end(),
                     [id](const TrunkInView &trunk) { return trunk.id == id; });
}

bool isFree(const Gap &gap, const std::vector<Obstacle> &trunks, const Eigen::Vector2d &from,
            const GapTaskOptions &options)
{
  const Eigen::Vector2d entry = gap.middle - kStraight * gap.along, exit = gap.middle + kStraight * gap.along;
  for (const Obstacle &other : trunks) {
    if (other.id == gap.left || other.id == gap.right)
      continue;
    const double near = std::min(distanceToSegment(other.xy, from, entry), distanceToSegment(other.xy, entry, exit));
    if (near - other.radius < options.way.hull + options.way.free)
      return false;
  }
  return true;
}
} // namespace

Gap gapBetween(const Obstacle &one, const Obstacle &other, const Eigen::Vector2d &from)
{
  const Eigen::Vector2d across = (other.xy - one.xy).normalized();
  const double free = (other.xy - one.xy).norm() - one.radius - other.radius;
  Gap gap;
  gap.middle = one.xy + (one.radius + 0.5 * free) * across;
  gap.along = leftOf(across);
  if (gap.along.dot(gap.middle - from) < 0)
    gap.along = -gap.along;
  gap.width = free;
  const bool one_is_left = leftOf(gap.along).dot(one.xy - gap.middle) > 0;
  gap.left = one_is_left ? one.id : other.id;
  gap.right = one_is_left ? other.id : one.id;
  return gap;
}

std::optional<Gap> chooseGap(const std::vector<Obstacle> &trunks, const Eigen::Vector2d &from, double heading,
                             double evidence, const GapTaskOptions &options)
{
  std::optional<Gap> best;
  double best_angle = options.angle;
  for (const Obstacle &one : trunks)
    for (const Obstacle &other : trunks) {
      if (one.id >= other.id || !one.is_confirmed || !other.is_confirmed ||
          std::min(one.evidence, other.evidence) < evidence)
        continue;
      const Gap gap = gapBetween(one, other, from);
      const Eigen::Vector2d w = gap.middle - from;
      const double angle = std::abs(std::remainder(std::atan2(w.y(), w.x()) - heading, 2 * M_PI));
      const double turned = std::abs(std::remainder(std::atan2(gap.along.y(), gap.along.x()) - heading, 2 * M_PI));
      if (gap.width < options.width_min || gap.width > options.width_max || w.norm() > options.range ||
          w.dot(gap.along) < 1 || turned > 1 || angle >= best_angle || !isFree(gap, trunks, from, options))
        continue;
      best = gap;
      best_angle = angle;
    }
  return best;
}

GapTask::GapTask(const GapTaskOptions &options) : ServoTask({}, options.response), m_options(options) {}

ServoTask::Values GapTask::errors() const
{
  if (!m_gap)
    return {};
  return {{"across [m]", m_across}, {"to go [m]", -m_ahead}};
}

/// At least one of its trunks is in view, or, near it, neither is where the camera looks.
bool GapTask::sees(const FrameReport &report) const
{
  if (!m_gap || trackedTrunk(report, m_gap->left) || trackedTrunk(report, m_gap->right))
    return true;
  return m_ahead > -kLeavesView && !isLookedFor(report, m_gap->left) && !isLookedFor(report, m_gap->right);
}

TaskCommand GapTask::search(const FrameReport &report)
{
  const double time_s = secondsOf(report.stamp_ns);
  TaskCommand command{false, m_sidestep.velocity(report.wMb, time_s), "sidesteps to find a gap"};
  const double elapsed = m_sidestep.elapsed(time_s);
  if (elapsed > m_options.search_s) {
    enter(TaskPhase::failed);
    return {true, Eigen::Vector4d::Zero(), "no gap found"};
  }
  if (elapsed > kSweep_s)
    m_gap = chooseGap(obstacles(report, 12, kViews), m_sidestep.start().t.head<2>(), yawOf(m_sidestep.start()),
                      elapsed > 2 * kSweep_s ? -100 : m_options.evidence, m_options);
  if (m_gap)
    enter(TaskPhase::servoing);
  return command;
}

/// The gap where the map has it now; while one of its trunks is gone from the map, where it was last.
void GapTask::refresh(const std::vector<Obstacle> &trunks, const Pose &wMb)
{
  std::optional<Obstacle> left, right;
  for (const Obstacle &trunk : trunks) {
    if (trunk.id == m_gap->left)
      left = trunk;
    if (trunk.id == m_gap->right)
      right = trunk;
  }
  if (left && right)
    m_gap = gapBetween(*left, *right, m_gap->middle - m_gap->along);
  const Eigen::Vector2d from_middle = wMb.t.head<2>() - m_gap->middle;
  m_ahead = from_middle.dot(m_gap->along);
  m_across = from_middle.dot(leftOf(m_gap->along));
}

TaskCommand GapTask::fly(std::vector<Obstacle> surfaces, const Pose &wMb)
{
  if (m_ahead > m_options.beyond) {
    enter(TaskPhase::done);
    return {true, Eigen::Vector4d::Zero(), "through"};
  }
  Eigen::Matrix2d axes; // along, to the left
  axes << m_gap->along.transpose(), leftOf(m_gap->along).transpose();
  for (Obstacle &surface : surfaces) {
    surface.xy = axes * (surface.xy - m_gap->middle);
    surface.covariance = axes * surface.covariance * axes.transpose();
  }
  WayGoal goal;
  goal.x_end = m_options.beyond + 1;
  goal.y_high = std::abs(m_across) + 2;
  goal.y_low = -goal.y_high;
  goal.detour = [this](double, double y) { return m_options.off_axis * std::abs(y); };
  goal.is_wall = [half = 0.5 * m_gap->width](double x, double y) { return std::abs(x) < kWall && std::abs(y) > half; };
  const auto room_at = [&](double x, double y) {
    return around().roomAt(m_gap->middle + axes.transpose() * Eigen::Vector2d(x, y));
  };
  m_way = planWay(surfaces, axes * (response().rest() - m_gap->middle), goal, m_options.way, m_way, room_at);
  const Eigen::Vector2d velocity = axes.transpose() * (m_way.speed / response().obeyed() * m_way.ahead);
  const Eigen::Vector2d look =
      m_ahead < -kStopsTurning ? m_gap->middle - wMb.t.head<2>() : m_gap->along; // keeps both in view
  return {false, towards(wMb, velocity, std::atan2(look.y(), look.x())), m_way.is_open ? "flies" : "no way"};
}

/// It may stand between trunks now, and the last search was straight behind: sweeps less.
void GapTask::giveUpTarget()
{
  m_gap.reset();
  m_way = {};
  m_sidestep.restart(kSearchAgain);
  enter(TaskPhase::searching);
}

TaskCommand GapTask::act(const FrameReport &report)
{
  if (!m_gap)
    return search(report);
  const std::vector<Obstacle> surfaces = around().surfaces(report, 20, kViews);
  refresh(surfaces, report.wMb);
  return fly(surfaces, report.wMb);
}
} // namespace bole
