// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/tasks/trunk_task.h>

#include <algorithm>
#include <cmath>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
constexpr double kSweep_s = 9;          ///< one sidestep to and fro before a trunk is chosen
constexpr double kPause_s = 0.25;       ///< without a command it hovered: what was sent before is over
constexpr double kFirstDrift = 0.3;     ///< standard deviation of the velocity nobody ordered, at first [m/s]
constexpr double kLargestDrift = 0.5;   ///< that is fed forward [m/s]
constexpr double kSameTrunk = 0.5;      ///< a trunk that took the target's place stands this near [m]
constexpr double kLargestTurn = 0.8;    ///< [rad/s]
} // namespace

void TrunkTaskOptions::validate() const
{
  const auto require = [](const char *name, double value, double low, double high) {
    if (!(value >= low && value <= high))
      throw vpException(vpException::badValue, "%s = %g, must be in [%g, %g]", name, value, low, high);
  };
  require("ratio", ratio, 0, 0.5);
  require("distance", distance, 0.5, 20);
  require("bearing", bearing, -0.5, 0.5);
  require("speed", speed, -2, 2);
  require("gain", gain, 0.05, 3);
  require("bearing_noise", bearing_noise, 1e-5, 0.1);
  require("ratio_noise", ratio_noise, 1e-5, 0.5);
  require("unrest", unrest, 1e-3, 2);
  require("largest_speed", largest_speed, 0.05, 3);
  require("choice_angle", choice_angle, 0.02, 0.6);
  require("choice_range", choice_range, 1, 20);
  require("choice_views", choice_views, 1, 1000);
  require("search_s", search_s, 1, 600);
  response.validate();
  safety.validate();
}

TrunkTask::TrunkTask(const Pose &bMc, const TrunkTaskOptions &options)
  : ServoTask(options.safety), m_bMc(bMc), m_options(options), m_sidestep(0.7, kSweep_s),
    m_response(options.response)
{
  m_options.validate();
  m_servo.setServo(vpServo::EYEINHAND_L_cVe_eJe);
  m_servo.setInteractionMatrixType(vpServo::CURRENT, vpServo::PSEUDO_INVERSE);
  m_servo.setLambda(m_options.gain);
  m_servo.addFeature(m_current, m_desired, vpFeatureTrunk::selectBearing() | vpFeatureTrunk::selectLogRatio());
  m_servo.set_cVe(vpVelocityTwistMatrix(m_bMc.inverse().toVisp()));
  vpMatrix eJe(6, 3);
  eJe[0][0] = eJe[1][1] = eJe[5][2] = 1; // vx, vy, wz
  m_servo.set_eJe(eJe);
}

TrunkTask::~TrunkTask() { m_servo.kill(); }

ServoTask::Values TrunkTask::errors() const
{
  if (!m_has_feature)
    return {};
  return {{"bearing [deg]", (m_bearing.value() - m_options.bearing) * 180 / M_PI},
          {"distance [%]", 100 * (m_ratio * std::exp(-m_log_ratio.value()) - 1)}};
}

bool TrunkTask::sees(const FrameResult &result, const Pipeline &) const
{
  return m_target < 0 || trackedTrunk(result, m_target) != nullptr;
}

/// The nearest confirmed trunk straight ahead of where the search began.
int TrunkTask::choose(const Pipeline &pipeline, const Pose &wMb) const
{
  int best = -1;
  double best_range = m_options.choice_range;
  const double heading = yawOf(m_sidestep.start());
  for (const MapTrunk &trunk : pipeline.mapTrunks()) {
    if (trunk.removed || trunk.status != TrunkStatus::confirmed || trunk.observations < m_options.choice_views)
      continue;
    const Eigen::Vector2d w = trunk.trunk.axisAt(wMb.t.z()).head<2>() - m_sidestep.start().t.head<2>();
    const double angle = std::remainder(std::atan2(w.y(), w.x()) - heading, 2 * M_PI);
    if (std::abs(angle) < m_options.choice_angle && w.norm() < best_range) {
      best = trunk.id;
      best_range = w.norm();
    }
  }
  return best;
}

/// The trunk that stands where the target stood: ids change when trunks merge.
int TrunkTask::successor(const Pipeline &pipeline) const
{
  for (const MapTrunk &trunk : pipeline.mapTrunks())
    if (!trunk.removed && trunk.status != TrunkStatus::lost && (trunk.trunk.xy - m_place).norm() < kSameTrunk)
      return trunk.id;
  return -1;
}

TaskCommand TrunkTask::search(const FrameResult &result, const Pipeline &pipeline, double time_s)
{
  TaskCommand command;
  command.velocity = m_sidestep.velocity(result.wMb, time_s);
  command.is_hovering = false;
  command.reason = "sidesteps to find a trunk";
  const double elapsed = m_sidestep.elapsed(time_s);
  if (elapsed > m_options.search_s) {
    enter(TaskPhase::failed);
    return {true, Eigen::Vector4d::Zero(), "no trunk found"};
  }
  if (elapsed > kSweep_s)
    m_target = choose(pipeline, result.wMb);
  if (m_target >= 0) {
    enter(TaskPhase::servoing);
    m_has_feature = false;
  }
  return command;
}

void TrunkTask::desire(double radius)
{
  m_ratio = m_options.ratio > 0 ? m_options.ratio : std::min(0.5, radius / m_options.distance);
  m_desired.buildFrom(m_options.bearing, 0, 0, std::log(m_ratio), radius);
}

RelativeTrunk TrunkTask::look(const FrameResult &result, const MapTrunk &trunk) const
{
  if (const TrackedTrunk *tracked = trackedTrunk(result, m_target))
    return tracked->relative;
  return relativeTrunk(result.wMb, m_bMc, trunk.trunk);
}

TaskCommand TrunkTask::act(const FrameResult &result, const Pipeline &pipeline)
{
  const double time_s = 1e-9 * static_cast<double>(result.stamp_ns);
  if (m_target >= 0 && !liveTrunk(pipeline, m_target))
    m_target = successor(pipeline);
  const MapTrunk *trunk = liveTrunk(pipeline, m_target);
  if (!trunk) {
    if (phase() == TaskPhase::servoing)
      m_sidestep.restart();
    m_has_feature = false;
    enter(TaskPhase::searching);
    const TaskCommand command = search(result, pipeline, time_s);
    m_response.send(time_s, command.velocity);
    return command;
  }
  m_place = trunk->trunk.xy;
  const RelativeTrunk seen = look(result, *trunk);
  if (!seen.isFinite())
    return {true, Eigen::Vector4d::Zero(), "too near: hovers"};
  vpFeatureTrunk feature;
  feature.buildFrom(seen, trunk->trunk.radius());
  return {false, velocityFor(feature, trunk->trunk.radius(), time_s), m_options.speed != 0 ? "circles" : "holds"};
}

/// How bearing and log r/d of \p feature move with (vx, vy, vz, wz) of the body.
Eigen::Matrix<double, 2, 4> TrunkTask::interactionOf(vpFeatureTrunk feature) const
{
  const vpMatrix L = feature.interaction(vpFeatureTrunk::selectBearing() | vpFeatureTrunk::selectLogRatio()) *
                     vpMatrix(vpVelocityTwistMatrix(m_bMc.inverse().toVisp()));
  Eigen::Matrix<double, 2, 4> J;
  for (unsigned row = 0; row < 2; ++row)
    J.row(row) << L[row][0], L[row][1], L[row][2], L[row][5];
  return J;
}

/// Brings the filters to the frame of \p time_s, in which \p feature was seen.
void TrunkTask::filter(const vpFeatureTrunk &feature, double time_s)
{
  const double dt = time_s - m_time_s, d = feature.distance();
  if (dt > kPause_s) {
    m_response = DroneResponse(m_options.response);
    m_has_feature = false;
  }
  const Eigen::Vector4d path = m_response.advance(time_s);
  if (m_has_feature) {
    const Eigen::Vector2d moved = interactionOf(feature) * path;
    m_bearing.predict(moved(0), dt, m_options.unrest / d);
    m_log_ratio.predict(moved(1), dt, m_options.unrest / d);
    m_bearing.correct(feature.bearing(), m_options.bearing_noise);
    m_log_ratio.correct(feature.logRatio(), m_options.ratio_noise);
  }
  else {
    m_bearing.start(feature.bearing(), m_options.bearing_noise, kFirstDrift / d);
    m_log_ratio.start(feature.logRatio(), m_options.ratio_noise, kFirstDrift / d);
  }
  m_has_feature = true;
  m_time_s = time_s;
}

/// m_current as it would come to stand if the drone's lags ran out from when the command acts; the drift that is fed
/// forward [1/s].
Eigen::Vector2d TrunkTask::lead(const vpFeatureTrunk &feature, double radius)
{
  const ResponseOptions &response = m_options.response;
  const auto J = interactionOf(feature);
  DroneResponse ahead = m_response;
  const Eigen::Vector2d path = J * ahead.advance(m_time_s + response.delay);
  const double most = kLargestDrift / feature.distance();
  const Eigen::Vector2d drift(std::clamp(m_bearing.drift(), -most, most), std::clamp(m_log_ratio.drift(), -most, most));
  const Eigen::Vector2d rate = J * ahead.velocity() + drift;
  const double lead_s = response.delay;
  m_current.buildFrom(m_bearing.value() + path(0) + lead_s * drift(0) + response.turn_lag * rate(0), feature.inclination(),
                      feature.tip(), m_log_ratio.value() + path(1) + lead_s * drift(1) + response.speed_lag * rate(1),
                      radius);
  return drift;
}

Eigen::Vector4d TrunkTask::velocityFor(const vpFeatureTrunk &feature, double radius, double time_s)
{
  filter(feature, time_s);
  desire(radius);
  const Eigen::Vector2d drift = lead(feature, radius);
  vpColVector v = m_servo.computeControlLaw(), against(2);
  against[0] = -drift(0);
  against[1] = -drift(1);
  v += m_servo.getTaskJacobianPseudoInverse() * against;
  if (m_options.speed != 0) {
    vpColVector round(3); // going left the trunk moves right: turn right with it
    round[1] = m_options.speed;
    round[2] = -m_options.speed / m_current.distance();
    v += m_servo.secondaryTask(round);
  }
  const Eigen::Vector2d flat = limited({v[0], v[1]}, m_options.largest_speed);
  const Eigen::Vector4d velocity(flat.x(), flat.y(), 0, std::clamp(v[2], -kLargestTurn, kLargestTurn));
  m_response.send(time_s, velocity);
  return velocity;
}
} // namespace bole
