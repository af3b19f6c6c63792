// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/trunk_task.h"

#include "support/units.h"
#include <bole/pose.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace bole
{
namespace
{
constexpr double kSidestep_s =
    9; ///< one sidestep to and fro before a trunk is chosen, another before doubtful ones are
constexpr double kChoiceAngle = 0.35;    ///< trunks farther from straight ahead are not chosen [rad]
constexpr double kChoiceRange = 7;       ///< nor those beyond this [m]
constexpr double kChoiceEvidence = 2;    ///< nor, at first, those of lower log odds to be one
constexpr int kChoiceViews = 25;         ///< a trunk seen less often is not chosen yet: what is none is given up sooner
constexpr double kBearingNoise = 0.0015; ///< of a tracked trunk in one image [rad]: a third of a pixel
constexpr double kMapBearingNoise = 0.006; ///< of one by map and pose: the pose scatters by a pixel and more [rad]
constexpr double kRatioNoise = 0.025;      ///< of its log r/d: half a pixel on a width of 20
constexpr double kUnrest = 0.15;           ///< of the velocity sideways that nobody ordered [m/s per root of a second]
constexpr double kApproachUnrest = 0.06;   ///< and of that ahead: more leaves a modulus margin below .5
constexpr double kFlownNoise = 0.009;      ///< of the way from frame to frame, by pose [m]
constexpr double kTurnedNoise = 0.002;     ///< and of its turn [rad]
constexpr double kSwing = 0.69;    ///< to either side, where a distance is asked for [m]: 13 degrees of parallax at 3 m
constexpr double kSwingUp = 0.38;  ///< above and below meanwhile [m]
constexpr double kSwayShare = 0.9; ///< of SafetyOptions::unseen_speed, for nothing looks sideways; the rest is for drag
constexpr double kReturn_s = 4;    ///< in which it returns to the way of the sway
constexpr double kPause_s = 0.25;  ///< without a command it hovered: what was sent before is over
constexpr double kFirstDrift = 0.3;      ///< standard deviation of the velocity nobody ordered, at first [m/s]
constexpr double kLargestDrift = 0.5;    ///< that is fed forward [m/s]
constexpr double kSameTrunk = 0.5;       ///< a trunk that took the target's place stands this near [m]
constexpr double kSameSide_s = 5;        ///< over which the images tell the radius: a radian of the way round
constexpr double kReadAgain = 0.1;       ///< of the log radius in the map, between two frames: other borders
constexpr double kMisreadJump = 0.12;    ///< a jump of log r/d that no motion explains: other edges than the trunk's
constexpr int kBelieved = 15;            ///< frames in a row after which it is believed all the same
constexpr double kRetreat = 0.3;         ///< backs off no faster: nothing looks behind [m/s]
constexpr int kPatience = 10;            ///< frames that the way round is blocked before it goes round the other way
constexpr double kWayRange = 3;          ///< of trunks that may stand in the way round [m]
constexpr double kLargestTurnRate = 0.8; ///< [rad/s]
constexpr double kNearestRatio = 0.5;    ///< r/d that is asked for or predicted: beyond it the hull touches most trunks

/// What a drone flies that is sent \p velocity and obeys by \p share: only the horizontal velocity is a balance with
/// drag.
Eigen::Vector4d obeying(Eigen::Vector4d velocity, double share)
{
  velocity.head<2>() *= share;
  return velocity;
}
} // namespace

TrunkTask::TrunkTask(const Pose &bMc, const TrunkTaskOptions &options)
    : ServoTask({}, options.response),
      m_bMc(bMc),
      m_options(options),
      m_sidestep(0.7, kSidestep_s),
      m_response(options.response),
      m_bearing_noise(kBearingNoise)
{
  m_servo.setServo(vpServo::EYEINHAND_L_cVe_eJe);
  m_servo.setInteractionMatrixType(vpServo::CURRENT, vpServo::PSEUDO_INVERSE);
  m_servo.setLambda(m_options.gain);
  m_servo.addFeature(m_current, m_desired, vpFeatureTrunk::selectBearing() | vpFeatureTrunk::selectLogRatio());
  m_servo.set_cVe(vpVelocityTwistMatrix(m_bMc.inverse().toVisp()));
  vpMatrix eJe(6, 2);
  eJe[0][0] = eJe[5][1] = 1; // vx, wz
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

bool TrunkTask::sees(const FrameReport &report) const
{
  return m_target < 0 || trackedTrunk(report, m_target) != nullptr;
}

/// The nearest trunk straight ahead of where the search began that is surely one; after two sweeps without such a one,
/// the surest that is confirmed.
int TrunkTask::choose(const FrameReport &report, double elapsed_s) const
{
  const KnownTrunk *nearest = nullptr, *surest = nullptr;
  double least_range = kChoiceRange;
  const double heading = yawOf(m_sidestep.start());
  for (const KnownTrunk &trunk : report.map) {
    if (trunk.status != TrunkStatus::confirmed || trunk.observations < kChoiceViews)
      continue;
    const Pose &start = m_sidestep.start();
    const Eigen::Vector2d w = trunk.trunk.axisAt(start.t.z()).head<2>() - start.t.head<2>();
    const double angle = std::remainder(std::atan2(w.y(), w.x()) - heading, 2 * M_PI), range = w.norm();
    if (std::abs(angle) > kChoiceAngle || range > kChoiceRange)
      continue;
    const double evidence = trunk.log_odds;
    if (!surest || evidence > surest->log_odds)
      surest = &trunk;
    if (evidence >= kChoiceEvidence && range < least_range) {
      nearest = &trunk;
      least_range = range;
    }
  }
  if (nearest)
    return nearest->id;
  return surest && elapsed_s > 2 * kSidestep_s ? surest->id : -1;
}

/// The trunk that stands where the target stood: ids change when trunks merge.
int TrunkTask::successor(const FrameReport &report) const
{
  for (const KnownTrunk &trunk : report.map)
    if (trunk.status != TrunkStatus::lost && (trunk.trunk.xy - m_place).norm() < kSameTrunk)
      return trunk.id;
  return -1;
}

TaskCommand TrunkTask::search(const FrameReport &report, double time_s)
{
  TaskCommand command;
  command.velocity = m_sidestep.velocity(report.wMb, time_s);
  command.is_hovering = false;
  command.reason = "sidesteps to find a trunk";
  const double elapsed = m_sidestep.elapsed(time_s);
  if (elapsed > m_options.search_s) {
    enter(TaskPhase::failed);
    return {true, Eigen::Vector4d::Zero(), "no trunk found"};
  }
  if (elapsed > kSidestep_s)
    m_target = choose(report, elapsed);
  if (m_target >= 0) {
    enter(TaskPhase::servoing);
    forgetFeature();
  }
  return command;
}

void TrunkTask::desire(double radius)
{
  m_ratio = m_options.ratio > 0 ? m_options.ratio : std::min(kNearestRatio, radius / m_options.distance);
  m_desired.buildFrom(m_options.bearing, 0, 0, std::log(m_ratio), radius);
}

/// The bearing as tracked in this image. The distance as the map has it: pose and place in it rest on all images, while
/// what one image takes for a border wanders by a tenth of the width. Where a ratio is asked for, the radius is that of
/// the last seconds: the trunk as seen from here may be wider or narrower than in the map, which has it from all sides
/// (m_log_radius).
RelativeTrunk TrunkTask::look(const FrameReport &report, const KnownTrunk &trunk)
{
  RelativeTrunk seen = relativeTrunk(report.wMb, m_bMc, trunk.trunk);
  const TrunkInView *tracked = trackedTrunk(report, m_target);
  const bool is_in_image = tracked && seen.isFinite() && tracked->relative.isFinite();
  m_bearing_noise = is_in_image ? kBearingNoise : kMapBearingNoise;
  if (!is_in_image)
    return seen;
  seen.cRt = tracked->relative.cRt;
  if (m_options.ratio <= 0)
    return seen;
  const double radius = trunk.trunk.log_radius + tracked->relative.log_ratio - seen.log_ratio;
  const bool is_misread = m_log_radius && std::abs(radius - *m_log_radius) > kMisreadJump;
  m_misread = is_misread ? m_misread + 1 : 0;
  const double since_s = secondsOf(report.stamp_ns - std::exchange(m_radius_ns, report.stamp_ns));
  if (!m_log_radius || m_misread > kBelieved) // it does look like that from here
    m_log_radius = radius;
  else if (!is_misread)
    *m_log_radius += (1 - std::exp(-since_s / kSameSide_s)) * (radius - *m_log_radius);
  seen.log_ratio += *m_log_radius - trunk.trunk.log_radius;
  return seen;
}

/// The way from the frame that the filters stand at, in the body there.
std::optional<Eigen::Vector4d> TrunkTask::flownTo(const Pose &wMb)
{
  const std::optional<Pose> from = std::exchange(m_wMb, wMb);
  if (!from || !m_has_feature)
    return std::nullopt;
  const Pose step = from->inverse() * wMb;
  Eigen::Vector4d flown;
  flown << step.t, logSo3(step.R).z();
  return flown;
}

void TrunkTask::forgetFeature()
{
  m_wMb.reset();
  m_has_feature = false;
  m_log_radius.reset();
}

void TrunkTask::giveUpTarget()
{
  m_target = -1;
  forgetFeature();
  m_sway.reset();
  m_ratio = 0;
  m_sidestep.restart();
  enter(TaskPhase::searching);
}

TaskCommand TrunkTask::act(const FrameReport &report)
{
  const double time_s = secondsOf(report.stamp_ns);
  if (m_target >= 0 && !knownTrunk(report, m_target))
    m_target = successor(report);
  const KnownTrunk *trunk = knownTrunk(report, m_target);
  if (!trunk) {
    if (phase() == TaskPhase::servoing)
      giveUpTarget();
    return search(report, time_s);
  }
  if (std::abs(trunk->trunk.log_radius - m_map_log_radius) > kReadAgain)
    forgetFeature();
  m_map_log_radius = trunk->trunk.log_radius;
  m_place = trunk->trunk.xy;
  const RelativeTrunk seen = look(report, *trunk);
  if (!seen.isFinite())
    return {true, Eigen::Vector4d::Zero(), "too near: hovers"};
  vpFeatureTrunk feature;
  feature.buildFrom(seen, trunk->trunk.radius());
  const Eigen::Vector2d sway = swayNow(time_s, report.wMb.t);
  const double wanted = m_turned_back * m_options.speed + sway.x();
  const bool is_free = isFree(trunk->id, obstacles(report, kWayRange, 1), report.wMb, wanted);
  m_blocked = is_free ? 0 : m_blocked + 1;
  if (m_blocked > kPatience) {
    m_turned_back = -m_turned_back;
    m_blocked = 0;
  }
  const double round = is_free ? wanted : 0;
  TaskCommand command{false, velocityFor(feature, trunk->trunk.radius(), time_s, round, flownTo(report.wMb)), "holds"};
  command.velocity.z() = sway.y();
  if (sway != Eigen::Vector2d::Zero())
    command.reason = "holds, swaying";
  else if (m_options.speed != 0)
    command.reason = round != 0 ? "circles" : "way blocked: waits";
  return command;
}

/// Velocity to the left and up [m/s], as much as may be ordered where nothing was seen; 0 where no distance is asked
/// for. It returns to the way that was begun: wind and hovering would move it to where nobody looked.
/// \p place: of the drone in the world [m].
Eigen::Vector2d TrunkTask::swayNow(double time_s, const Eigen::Vector3d &place)
{
  if (m_options.speed != 0 || m_options.ratio > 0)
    return Eigen::Vector2d::Zero();
  const Eigen::Vector2d from_trunk = place.head<2>() - m_place;
  const double azimuth = std::atan2(from_trunk.y(), from_trunk.x());
  if (!m_sway)
    m_sway = {time_s, azimuth, place.z()};
  const double fastest = kSwayShare * SafetyOptions().unseen_speed;
  const double rate = fastest / kSwing; // rad/s
  const double angle = rate * (time_s - m_sway->start_s);
  const Eigen::Vector2d swing(kSwing, kSwingUp);
  const Eigen::Vector2d flown(-from_trunk.norm() * std::remainder(azimuth - m_sway->azimuth, 2 * M_PI),
                              place.z() - m_sway->height);
  Eigen::Vector2d velocity = rate * std::cos(angle) * swing + (std::sin(angle) * swing - flown) / kReturn_s;
  velocity.x() = std::clamp(velocity.x(), -fastest, fastest); // what is cut is not what the predictor knows
  return velocity;
}

/// Sent anew where it was cut: of two sent at one time the later counts. The next one sideways will be cut alike.
void TrunkTask::sent(const Eigen::Vector4d &velocity, const FrameReport &report)
{
  const Eigen::Vector4d flown = obeying(velocity, response().obeyed());
  m_uncut = m_round != 0 ? std::clamp(flown.y() / m_round, 0.0, 1.0) : 1;
  m_response.send(secondsOf(report.stamp_ns), flown);
}

/// Whether no other trunk stands near on the side to which \p speed leads (positive: left).
bool TrunkTask::isFree(int target, const std::vector<Obstacle> &around, const Pose &wMb, double speed) const
{
  const Eigen::Vector2d way = (speed > 0 ? 1 : -1) * wMb.R.col(1).head<2>().normalized();
  for (const Obstacle &other : around)
    if (other.id != target && other.is_confirmed && way.dot(other.xy - wMb.t.head<2>()) > 0 &&
        other.clearance(wMb.t.head<2>(), 1) < m_options.free_way)
      return false;
  return true;
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
void TrunkTask::filter(const vpFeatureTrunk &feature, double time_s, const std::optional<Eigen::Vector4d> &flown)
{
  const double dt = time_s - m_time_s, d = feature.distance();
  if (dt > kPause_s) {
    m_response = DroneResponse(m_options.response);
    m_has_feature = false;
  }
  const Eigen::Vector4d path = m_response.advance(time_s);
  if (m_has_feature) {
    const Eigen::Vector2d moved = interactionOf(feature) * path;
    m_bearing.predict(moved(0), dt, kUnrest / d);
    m_log_ratio.predict(moved(1), dt, kApproachUnrest / d);
    if (flown && dt > 0) {
      const Eigen::Vector2d unordered = interactionOf(feature) * (*flown - path) / dt;
      m_bearing.correctDrift(unordered(0), std::hypot(kFlownNoise / d, kTurnedNoise) / dt);
      m_log_ratio.correctDrift(unordered(1), kFlownNoise / d / dt);
    }
    m_bearing.correct(feature.bearing(), m_bearing_noise);
    m_log_ratio.correct(feature.logRatio(), kRatioNoise);
  }
  else {
    m_bearing.start(feature.bearing(), m_bearing_noise, kFirstDrift / d);
    m_log_ratio.start(feature.logRatio(), kRatioNoise, kFirstDrift / d);
  }
  m_has_feature = true;
  m_time_s = time_s;
}

/// m_current as it would come to stand if the drone's lags ran out from when the command acts; how it will move besides
/// [1/s]: by its drift, and by flying sideways at \p round.
Eigen::Vector2d TrunkTask::lead(const vpFeatureTrunk &feature, double radius, double time_s, double round)
{
  const ResponseOptions &response = m_options.response;
  const Eigen::Matrix<double, 2, 4> J = interactionOf(feature);
  const double most = kLargestDrift / feature.distance();
  const Eigen::Vector2d drift(std::clamp(m_bearing.drift(), -most, most), std::clamp(m_log_ratio.drift(), -most, most));
  DroneResponse ahead = m_response;
  const Eigen::Vector2d there = J * ahead.advance(time_s + response.delay) + response.delay * drift;
  Eigen::Vector4d approach = response.speed_lag * ahead.velocity(); // what leads on sideways does not end
  approach.x() = ahead.coast().x();
  const double ratio = m_log_ratio.value() + there(1) + J.row(1).dot(approach) + response.speed_lag * drift(1);
  m_current.buildFrom(m_bearing.value() + there(0) + response.turn_lag * (J.row(0).dot(ahead.velocity()) + drift(0)),
                      feature.inclination(), feature.tip(), std::min(ratio, std::log(kNearestRatio)), radius);
  ahead.send(time_s, {0, m_uncut * round, 0, 0});
  ahead.advance(time_s + response.delay + response.turn_lag); // the turn lags too: it is to match what is flown then
  return drift + J.col(1) * ahead.velocity().y();
}

Eigen::Vector4d TrunkTask::velocityFor(const vpFeatureTrunk &feature, double radius, double time_s, double round,
                                       const std::optional<Eigen::Vector4d> &flown)
{
  filter(feature, time_s, flown);
  desire(radius);
  round = std::clamp(round, -m_options.largest_speed, m_options.largest_speed);
  const Eigen::Vector2d besides = lead(feature, radius, time_s, round);
  vpColVector v = m_servo.computeControlLaw(), against(2);
  against[0] = -besides(0);
  against[1] = -besides(1);
  v += m_servo.getTaskJacobianPseudoInverse() * against;
  const Eigen::Vector2d flat = limited({v[0], round}, m_options.largest_speed);
  Eigen::Vector4d velocity(std::max(flat.x(), -kRetreat), flat.y(), 0,
                           std::clamp(v[1], -kLargestTurnRate, kLargestTurnRate));
  m_round = velocity.y();
  m_response.send(time_s, velocity);
  return obeying(velocity, 1 / response().obeyed());
}
} // namespace bole
