// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/tasks/slalom_task.h"

#include "geometry/require_range.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace bole
{
namespace
{
constexpr double kStep_s = 0.1;      ///< of the simulated trajectories
constexpr double kOffsetStep = 0.25; ///< [m]
constexpr double kOffsetGain = 1.0;  ///< sideways velocity over offset [1/s]
constexpr double kOffLine = 0.12;    ///< cost a metre off the line
constexpr double kChange = 0.08;     ///< cost a metre between this offset and the one of the frame before
constexpr double kUnseen = 8;        ///< cost a second inside space that was not observed to be free
constexpr double kUnseenTo = 1.8;    ///< distance ahead up to which it must be observed [m]
constexpr double kRound = 0.12;      ///< distance from the hull at which it is asked [m]
constexpr double kSlow = 1.5;        ///< cost of standing still against full speed
constexpr double kNear = 12;         ///< cost a second of a square metre of the margin that is violated
constexpr double kContact =
    100; ///< cost of a contact, plus this for each metre of depth and each second that it is earlier
constexpr double kLook = 0.6;      ///< share of the direction of flight that the heading takes
constexpr double kSwingOn = 0.6;   ///< the sine goes on at no less than this speed [m/s]
constexpr double kLookAside = 0.6; ///< amplitude of the sidestep before it leaves [m]
constexpr double kRange = 9;       ///< trunks farther do not matter yet [m]

double line(double x, const SlalomTaskOptions &options)
{
  return options.swing * std::sin(2 * M_PI * x / options.wave_length);
}

double sidewaysTo(double offset, double y, const SlalomTaskOptions &options)
{
  return std::clamp(kOffsetGain * (offset - y), -options.sideways, options.sideways);
}

/// From hull to bark, covariance counted [m].
double clearanceOf(const Obstacle &trunk, const SlalomState &at, const SlalomTaskOptions &options)
{
  return trunk.clearance({at.x, at.y}, options.sigmas) - options.body_radius;
}

using Ring = std::array<Eigen::Vector2d, 8>;

/// Places about the hull, from its middle [m].
Ring ringRound(const SlalomTaskOptions &options)
{
  Ring ring;
  const double r = options.body_radius + kRound;
  for (std::size_t k = 0; k < ring.size(); ++k) {
    const double angle = 2 * M_PI * static_cast<double>(k) / static_cast<double>(ring.size());
    ring[k] = {r * std::cos(angle), r * std::sin(angle)};
  }
  return ring;
}

double unseenShare(const SlalomState &at, const Ring &ring, const IsSeen &is_seen)
{
  const auto unseen = std::count_if(ring.begin(), ring.end(), [&](const Eigen::Vector2d &place) {
    return !is_seen(at.x + place.x(), at.y + place.y());
  });
  return static_cast<double>(unseen) / static_cast<double>(ring.size());
}

/// Flies \p way in thought and fills its clearance and cost. \p allowed: of each trunk, what is nearer is a contact
/// [m].
void tryOut(SlalomWay &way, const std::vector<Obstacle> &trunks, const std::vector<double> &allowed, SlalomState state,
            const SlalomTaskOptions &options, const Ring &ring, const IsSeen &is_seen)
{
  const SlalomState start = state;
  way.clearance = std::numeric_limits<double>::infinity();
  double contact_s = options.horizon, depth = 0;
  for (double t = 0; t < options.horizon; t += kStep_s) {
    state.vy += kStep_s / options.lag * (sidewaysTo(way.offset, state.y, options) - state.vy);
    state.y += kStep_s * state.vy;
    state.x += kStep_s * way.speed;
    double clearance = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < trunks.size(); ++k) {
      const double to_trunk = clearanceOf(trunks[k], state, options);
      clearance = std::min(clearance, to_trunk);
      if (to_trunk < allowed[k])
        contact_s = std::min(contact_s, t);
      depth = std::max(depth, allowed[k] - to_trunk);
    }
    way.clearance = std::min(way.clearance, clearance);
    const double inside = std::max(0.0, options.margin - clearance); // for as long as it is: near a trunk, away from it
    way.cost += kStep_s * kNear * inside * inside;
    if (is_seen && std::hypot(state.x - start.x, state.y - start.y) < kUnseenTo)
      way.cost += kStep_s * kUnseen * unseenShare(state, ring, is_seen);
  }
  if (depth > 0)
    way.cost += kContact * (1 + depth + (options.horizon - contact_s));
}
} // namespace

void SlalomTaskOptions::validate() const
{
  requireRange("look", look, 0, 30);
  requireRange("length", length, 1, 1000);
  requireRange("speed", speed, 0.1, 3);
  requireRange("sideways", sideways, 0.1, 3);
  requireRange("swing", swing, 0, 3);
  requireRange("wave_length", wave_length, 2, 50);
  requireRange("reach", reach, 0.5, 10);
  requireRange("body_radius", body_radius, 0.05, 2);
  requireRange("margin", margin, 0, 3);
  requireRange("sigmas", sigmas, 0, 5);
  requireRange("views", views, 1, 1000);
  requireRange("horizon", horizon, 1, 20);
  requireRange("lag", lag, 0.05, 3);
  safety.validate();
}

SlalomWay chooseWay(const std::vector<Obstacle> &trunks, const SlalomState &state, double last_offset,
                    const SlalomTaskOptions &options, const IsSeen &is_seen)
{
  SlalomWay best;
  best.cost = std::numeric_limits<double>::infinity();
  const Ring ring = ringRound(options);
  const double wanted = line(state.x + state.lead + options.speed, options); // a second ahead
  std::vector<double> allowed;                                               // who stands too near already may leave
  allowed.reserve(trunks.size());
  for (const Obstacle &trunk : trunks)
    allowed.push_back(std::min(0.0, clearanceOf(trunk, state, options)));
  for (const double share : {1.0, 0.6, 0.25, 0.0})
    for (double offset = -options.reach; offset <= options.reach + 1e-9; offset += kOffsetStep) {
      SlalomWay way{wanted + offset, share * options.speed, 0, 0};
      if (std::abs(way.offset) > options.reach + options.swing)
        continue;
      way.cost = kOffLine * std::abs(offset) + kChange * std::abs(way.offset - last_offset) + kSlow * (1 - share);
      if (way.cost >= best.cost)
        continue;
      tryOut(way, trunks, allowed, state, options, ring, is_seen);
      if (way.cost < best.cost)
        best = way;
    }
  return best;
}

SlalomTask::SlalomTask(const SlalomTaskOptions &options)
    : ServoTask(options.safety), m_options(options), m_sidestep(kLookAside, std::max(options.look, 1e-3))
{
  m_options.validate();
}

ServoTask::Values SlalomTask::errors() const
{
  return {{"along [m]", m_state.x},
          {"across [m]", m_state.y},
          {"clearance by the map [m]", std::min(m_way.clearance, 9.0)}};
}

void SlalomTask::locate(const FrameReport &report)
{
  const double time_s = 1e-9 * static_cast<double>(report.stamp_ns);
  if (!m_started) {
    m_start = {Eigen::AngleAxisd(yawOf(report.wMb), Eigen::Vector3d::UnitZ()).toRotationMatrix(), report.wMb.t};
    m_started = true;
    m_time_s = time_s;
  }
  const Eigen::Vector3d p = m_start.inverse() * report.wMb.t;
  const double dt = time_s - m_time_s;
  if (dt > 0)
    m_state.vy += 0.4 * (std::clamp((p.y() - m_state.y) / dt, -2.0, 2.0) - m_state.vy);
  m_state.lead += std::max(0.0, kSwingOn * dt - (p.x() - m_state.x));
  m_state.x = p.x();
  m_state.y = p.y();
  m_time_s = time_s;
}

TaskCommand SlalomTask::act(const FrameReport &report)
{
  locate(report);
  if (!report.points.empty())
    m_seen.see(report.points, report.wMc.t, m_time_s);
  m_near_points.see(placedPoints(report, kNearRange), report.wMb, m_time_s);
  if (phase() == TaskPhase::searching && m_sidestep.elapsed(m_time_s) < m_options.look) {
    m_state.lead = 0;
    return {false, m_sidestep.velocity(report.wMb, m_time_s), "looks before it leaves"};
  }
  enter(m_state.x >= m_options.length ? TaskPhase::done : TaskPhase::servoing);
  if (phase() == TaskPhase::done)
    return {true, Eigen::Vector4d::Zero(), "arrived"};
  std::vector<Obstacle> trunks = obstacles(report, kRange, m_options.views);
  m_near_points.addTo(trunks, report.wMb, kNearRange);
  const Eigen::Matrix2d axes = m_start.R.topLeftCorner<2, 2>().transpose();
  for (Obstacle &trunk : trunks) {
    trunk.xy = axes * (trunk.xy - m_start.t.head<2>());
    trunk.covariance = axes * trunk.covariance * axes.transpose();
  }
  const auto is_seen = [&](double x, double y) {
    return m_seen.isSeen(m_start.t.head<2>() + axes.transpose() * Eigen::Vector2d(x, y));
  };
  m_way = chooseWay(trunks, m_state, m_way.offset, m_options, is_seen);
  const Eigen::Vector2d velocity(m_way.speed, sidewaysTo(m_way.offset, m_state.y, m_options));
  const double heading =
      yawOf(m_start) + kLook * std::atan2(velocity.y(), std::max(velocity.x(), 0.5 * m_options.speed));
  return {false, towards(report.wMb, axes.transpose() * velocity, heading),
          m_way.speed < m_options.speed ? "slows" : "flies"};
}
} // namespace bole
