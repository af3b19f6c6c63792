// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/sensor_calibration.h"

#include "geometry/constants.h"
#include "motion/calibration_fit.h"
#include "motion/camera_gyro.h"
#include "motion/inertial_scale.h"
#include "motion/sensor_monitor.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix23d = Eigen::Matrix<double, 2, 3>;

namespace calibration
{
namespace
{
constexpr double kLooksThrough_s = 10;
constexpr double kBaseline_s = 0.25; ///< least time between the two frames of a motion

constexpr double kLeastLate_s = 0.01; ///< less turns a body by less than what the points are worth [s]
constexpr double kMostScale = 0.5;    ///< of the log of the odometry's scale that is looked for
constexpr double kWideMount = 0.17;   ///< of the wide part of the prior on the odometry's attitude [rad]
constexpr double kScale = 0.03;       ///< of the narrow part of the prior on the log of the scale
constexpr double kWideScale = 0.25;   ///< of the wide one
constexpr double kWidePart = 0.1;     ///< of the odometries: those that are not as stated
constexpr double kPointsSigma = 7e-4; ///< of a rotation by points beside their own covariance [rad]
constexpr double kTurnSigma = 0.007;  ///< of the odometry's rotation between two poses [rad]
constexpr std::size_t kLeastMotions = 15;

/// The bias of a gyro that is \p late_s, by the rotations of the points.
Fitted fitBias(const GyroPath &path, const std::vector<Turn> &turns, double late_s, double overlap, double scatter)
{
  std::vector<Row> rows;
  for (const Turn &turn : turns) {
    const auto turned = path.between(turn.a_ns + nsOf(late_s), turn.b_ns + nsOf(late_s));
    if (turned) // the rates less the bias: what is left of it turns the other way
      rows.emplace_back(Matrix3d(turn.duration() * Matrix3d::Identity()),
                        logSo3(orthonormalized(turned->transpose() * turn.aRb)), turn.information, overlap);
  }
  return solve(rows, kWideBias * kWideBias, scatter);
}

/// The frames with the constants taken out.
std::vector<Frame> corrected(const std::vector<Frame> &frames, const SensorCalibration &calibration)
{
  constexpr std::int64_t kMostOdometryGap_ns = 1'000'000'000;
  Recording recording;
  for (const Frame &frame : frames) {
    recording.gyro.insert(recording.gyro.end(), frame.gyro.begin(), frame.gyro.end());
    if (frame.wMb_odometry)
      recording.odometry.push_back({frame.stamp_ns, *frame.wMb_odometry});
  }
  recording = bole::corrected(std::move(recording), calibration);
  std::vector<Frame> result;
  std::size_t at = 0;
  for (const Frame &frame : frames) {
    Frame now;
    now.stamp_ns = frame.stamp_ns;
    now.index = frame.index;
    now.wMb_odometry = interpolate(recording.odometry, frame.stamp_ns, kMostOdometryGap_ns);
    for (; at < recording.gyro.size() && recording.gyro[at].stamp_ns <= frame.stamp_ns; ++at)
      if (!result.empty())
        now.gyro.push_back(recording.gyro[at]);
    result.push_back(std::move(now));
  }
  return result;
}

std::vector<GyroSample> samplesOf(const std::vector<Frame> &frames)
{
  std::vector<GyroSample> samples;
  for (const Frame &frame : frames)
    samples.insert(samples.end(), frame.gyro.begin(), frame.gyro.end());
  return samples;
}

/// Estimates the constants, one after the other.
class Estimation
{
public:
  Estimation(const std::vector<Frame> &frames, const std::vector<RelativeMotion> &motions, const Pose &bMc,
             const GyroOptions &gyro)
      : m_frames(frames), m_motions(motions), m_bMc(bMc), m_gyro(gyro), m_samples(samplesOf(frames))
  {
    for (const RelativeMotion &motion : motions) {
      if (!motion.points.hasRotation())
        continue;
      Turn turn;
      turn.a_ns = motion.a_ns;
      turn.b_ns = motion.b_ns;
      turn.aRb = bMc.R * motion.points.aRb * bMc.R.transpose();
      const double white = std::pow(kPointsSigma, 2) + std::pow(gyro.noise_density, 2) * turn.duration();
      turn.information =
          (bMc.R * motion.points.covariance.topLeftCorner<3, 3>() * bMc.R.transpose() + white * Matrix3d::Identity())
              .inverse();
      m_turns.push_back(turn);
      m_overlap = std::max(m_overlap, static_cast<double>(motion.b_index - motion.a_index));
    }
  }

  SensorCalibration run()
  {
    if (!m_samples.empty() && m_turns.size() >= kLeastMotions)
      calibrateGyro();
    const SensorCalibration gyro_alone = m_result;
    if (!m_result.verdicts.empty())
      return m_result; // whatever else is measured rests on camera and gyro
    if (m_is_gyro_explained) {
      calibrateOdometryClock();
      calibrateRotation();
      calibrateScale();
    }
    judge();
    const auto is_odometry = [](const SensorVerdict &verdict) { return verdict.sensor == toString(Sensor::odometry); };
    if (std::none_of(m_result.verdicts.begin(), m_result.verdicts.end(), is_odometry))
      return m_result;
    SensorCalibration without_odometry = gyro_alone;
    without_odometry.verdicts = m_result.verdicts;
    return without_odometry;
  }

private:
  void calibrateGyro();
  void calibrateRotation();
  void calibrateOdometryClock();
  void calibrateScale();
  void judge();
  template <typename Take> void replay(const Take &take) const;
  void addDirections(const std::vector<Frame> &frames, std::vector<Row> &rows) const;
  void addGravity(const std::vector<Frame> &frames, std::vector<Row> &rows) const;
  void addTurns(const std::vector<Frame> &frames, const GyroPath &path, double late_s, std::vector<Row> &rows) const;

  void addConstant(const char *name, double value, double sigma, bool used, std::string text)
  {
    m_result.constants.push_back({name, value, sigma, used, std::move(text)});
  }

  const std::vector<Frame> &m_frames;
  const std::vector<RelativeMotion> &m_motions;
  Pose m_bMc;
  GyroOptions m_gyro;
  std::vector<GyroSample> m_samples;
  std::vector<Turn> m_turns;
  double m_overlap = 1; ///< turns that share an interval
  bool m_is_gyro_explained = false;
  SensorCalibration m_result;
};

void Estimation::calibrateGyro()
{
  Vector3d bias = Vector3d::Zero();
  Minimum late;
  Fitted fit;
  std::vector<Turn> turns;                  // that every offset can be tried on
  for (int round = 0; round < 2; ++round) { // the second one with the bias taken off exactly
    const GyroPath path(m_samples, bias);
    turns.clear();
    for (const Turn &turn : m_turns)
      if (path.between(turn.a_ns - nsOf(kMostLate_s), turn.b_ns + nsOf(kMostLate_s)))
        turns.push_back(turn);
    if (turns.size() < kLeastMotions)
      return;
    double best = std::numeric_limits<double>::max(), scatter = 1;
    for (int k = -kLateSteps; k <= kLateSteps; ++k) { // the scatter of the best offset is that of the noise
      const Fitted tried = fitBias(path, turns, kLateStep_s * k, m_overlap, 1);
      if (tried.cost < best) {
        best = tried.cost;
        scatter = 0;
        fit = fitBias(path, turns, kLateStep_s * k, m_overlap, scatter);
        scatter = std::sqrt(fit.covariance.trace() / tried.covariance.trace());
        scatter *= scatter;
      }
    }
    late = minimiseLate([&](double late_s) { return fitBias(path, turns, late_s, m_overlap, scatter).cost; });
    fit = fitBias(path, turns, late.is_inside ? late.late_s : 0, m_overlap, scatter);
    bias += fit.value;
  }
  m_result.verdicts = judgeCamera(GyroPath(m_samples, bias), turns, m_bMc.R, m_overlap);
  for (SensorVerdict &verdict : m_result.verdicts)
    verdict.since_s = secondsOf(m_frames.front().stamp_ns);
  m_is_gyro_explained = fit.failing < kMostFailing;
  if (!m_is_gyro_explained)
    return;
  const bool is_late = late.is_inside && late.gain > kBetter && std::abs(late.late_s) > kLeastLate_s;
  if (late.is_inside)
    addConstant("gyro_late_s", late.late_s, late.sigma_s, is_late,
                fmt::format("gyro: clock {:.0f} +- {:.0f} ms {}", 1e3 * std::abs(late.late_s),
                            std::ceil(1e3 * late.sigma_s), late.late_s > 0 ? "late" : "early"));
  if (is_late)
    m_result.gyro_late_s = late.late_s;
  const Matrix3d expected = fit.covariance + std::pow(m_gyro.bias_sigma, 2) * Matrix3d::Identity();
  const bool is_biased = bias.dot(expected.ldlt().solve(bias)) > kBetter;
  const double sigma = std::sqrt(fit.covariance.trace() / 3);
  addConstant("gyro_bias", bias.norm(), sigma, is_biased,
              fmt::format("gyro: bias {:.3f} +- {:.3f} rad/s", bias.norm(), sigma));
  if (is_biased)
    m_result.gyro_bias = bias;
}

/// Direction of flight: bRo takes that of the odometry to that of the points.
void Estimation::addDirections(const std::vector<Frame> &frames, std::vector<Row> &rows) const
{
  const SensorMonitorOptions noise;
  for (const RelativeMotion &motion : m_motions) {
    const Frame &a = frames[motion.a_index], &b = frames[motion.b_index];
    if (!motion.points.hasDirection() || motion.points.parallax_px < 1 || !a.wMb_odometry || !b.wMb_odometry)
      continue;
    const Vector3d moved = a.wMb_odometry->R.transpose() * (b.wMb_odometry->t - a.wMb_odometry->t);
    const double length = moved.norm(), dt = secondsOf(motion.b_ns - motion.a_ns);
    if (length < 0.05)
      continue;
    const Vector3d by_odometry = moved / length, by_points = m_bMc.R * motion.points.direction;
    const double variance =
        0.5 * motion.points.covariance.bottomRightCorner<2, 2>().trace() +
        (std::pow(noise.odometry_walk, 2) * dt + std::pow(noise.odometry_height_sigma, 2)) / (length * length) +
        std::pow(noise.odometry_relative, 2);
    Matrix23d across;
    across.row(0) = by_points.unitOrthogonal().transpose();
    across.row(1) = by_points.cross(Vector3d(across.row(0))).transpose();
    rows.emplace_back(Matrix23d(-across * skew(by_odometry)), Eigen::Vector2d(across * (by_odometry - by_points)),
                      Eigen::Matrix2d(Eigen::Matrix2d::Identity() / variance), m_overlap);
  }
}

/// Gravity: over all frames the mean force, turned by the odometry, is up.
void Estimation::addGravity(const std::vector<Frame> &frames, std::vector<Row> &rows) const
{
  constexpr double kSigma = 0.012;                   // of the tilt by the bias of an accelerometer, 0.1 m/s^2 [rad]
  constexpr std::int64_t kVelocity_ns = 290'000'000; // that a velocity is taken over: three frames at 10 Hz
  constexpr std::size_t kParts = 3;
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::size_t first = part * (frames.size() - 1) / kParts, last = (part + 1) * (frames.size() - 1) / kParts;
    Vector3d sum = Vector3d::Zero();
    Matrix3d by_rotation = Matrix3d::Zero();
    int count = 0;
    bool varies = false;
    std::optional<Vector3d> before;
    std::size_t steps = 1; // that a velocity is taken over
    while (first + steps < last && frames[first + steps].stamp_ns - frames[first].stamp_ns < kVelocity_ns)
      ++steps;
    if (last < first + 2 * steps + 2)
      return;
    for (std::size_t i = first + 1; i <= last; ++i) {
      if (!frames[i].wMb_odometry)
        return;
      for (const GyroSample &sample : frames[i].gyro) {
        if (!sample.force)
          return;
        varies = varies || (before && *before != *sample.force);
        before = sample.force;
        sum += frames[i].wMb_odometry->R * *sample.force;
        by_rotation += frames[i].wMb_odometry->R * skew(*sample.force);
        ++count;
      }
    }
    if (count < 40 || !varies || !frames[first].wMb_odometry)
      return;
    const auto velocity = [&](std::size_t i) {
      return Vector3d((frames[i + steps].wMb_odometry->t - frames[i].wMb_odometry->t) /
                      secondsOf(frames[i + steps].stamp_ns - frames[i].stamp_ns));
    };
    const double dt = secondsOf(frames[last].stamp_ns - frames[first].stamp_ns);
    const double lag = secondsOf(frames[first + steps].stamp_ns - frames[first].stamp_ns);
    const Vector3d acceleration = (velocity(last - steps) - velocity(first)) / std::max(0.1, dt - lag);
    const Vector3d up = sum / count - acceleration;
    const double sigma = std::hypot(kSigma, 0.1 / (kGravity * dt)); // 0.1 m/s: of a velocity
    rows.emplace_back(Matrix23d(by_rotation.topRows<2>() / count / kGravity), Eigen::Vector2d(up.head<2>() / kGravity),
                      Eigen::Matrix2d(Eigen::Matrix2d::Identity() / (sigma * sigma)), double(kParts));
  }
}

/// Rotations over half a second: bRo carries those of the odometry to those of the gyro.
void Estimation::addTurns(const std::vector<Frame> &frames, const GyroPath &path, double late_s,
                          std::vector<Row> &rows) const
{
  constexpr std::int64_t kApart_ns = 500'000'000;
  constexpr double kShared = 2; // turns that have an end in common
  std::size_t b = 0;
  for (std::size_t a = 0; a < frames.size(); ++a) {
    while (b < frames.size() && frames[b].stamp_ns < frames[a].stamp_ns + kApart_ns)
      ++b;
    if (b == frames.size())
      return;
    if (!frames[a].wMb_odometry || !frames[b].wMb_odometry)
      continue;
    const auto turned = path.between(frames[a].stamp_ns - nsOf(late_s), frames[b].stamp_ns - nsOf(late_s));
    if (!turned)
      continue;
    const Vector3d by_gyro = logSo3(*turned);
    const Vector3d by_odometry =
        logSo3(orthonormalized(frames[a].wMb_odometry->R.transpose() * frames[b].wMb_odometry->R));
    const double dt = secondsOf(frames[b].stamp_ns - frames[a].stamp_ns);
    const double variance = kTurnSigma * kTurnSigma + std::pow(m_gyro.bias_sigma * dt, 2);
    rows.emplace_back(Matrix3d(-skew(by_odometry)), Vector3d(by_odometry - by_gyro),
                      Matrix3d(Matrix3d::Identity() / variance), kShared);
  }
}

void Estimation::calibrateRotation()
{
  Matrix3d bRo = Matrix3d::Identity();
  Fitted fit;
  for (int round = 0; round < 4; ++round) {
    SensorCalibration tried = m_result;
    tried.bRo = bRo;
    const std::vector<Frame> frames = corrected(m_frames, tried);
    std::vector<Row> rows;
    addDirections(frames, rows);
    if (rows.size() < kLeastMotions) // the images must bear witness
      return;
    addGravity(frames, rows);
    addTurns(frames, GyroPath(samplesOf(frames), Vector3d::Zero()), 0, rows);
    fit = solve(rows, kWideMount * kWideMount);
    bRo = expSo3(fit.value) * bRo;
  }
  if (fit.failing >= kMostFailing)
    return;
  const Vector3d rotation = logSo3(bRo);
  const Matrix3d expected = fit.covariance + kMount * kMount * Matrix3d::Identity();
  const bool is_turned = rotation.dot(expected.ldlt().solve(rotation)) > kBetter;
  const double sigma = std::sqrt(fit.covariance.trace() / 3);
  addConstant("odometry_rotation", rotation.norm(), sigma, is_turned,
              fmt::format("odometry: body turned by {:.1f} +- {:.1f} degrees (roll {:.1f}, pitch {:.1f}, yaw {:.1f})",
                          rotation.norm() / kDegree, sigma / kDegree, rotation.x() / kDegree, rotation.y() / kDegree,
                          rotation.z() / kDegree));
  if (!is_turned)
    return;
  m_result.bRo = bRo;
  m_result.odometry_rotation_sigma = sigma;
}

void Estimation::calibrateOdometryClock()
{
  SensorCalibration tried = m_result;
  tried.odometry_late_s = 0;
  const std::vector<Frame> frames = corrected(m_frames, tried);
  const GyroPath path(samplesOf(frames), Vector3d::Zero());
  std::vector<Frame> usable; // that every offset can be tried on
  for (const Frame &frame : frames)
    if (path.between(frame.stamp_ns - nsOf(kMostLate_s), frame.stamp_ns + nsOf(kMostLate_s)))
      usable.push_back(frame);
  if (usable.size() < 2 * kLeastMotions)
    return;
  const auto fitAt = [&](double late_s, double scatter) {
    std::vector<Row> rows;
    addTurns(usable, path, late_s, rows);
    return solve(rows, kWideMount * kWideMount, scatter); // whatever its body stands like
  };
  double best = std::numeric_limits<double>::max(), scatter = 1;
  for (int k = -kLateSteps; k <= kLateSteps; ++k) {
    const Fitted plain = fitAt(kLateStep_s * k, 1);
    if (plain.cost < best) {
      best = plain.cost;
      scatter = fitAt(kLateStep_s * k, 0).covariance.trace() / plain.covariance.trace();
    }
  }
  const auto cost = [&](double late_s) { return fitAt(late_s, scatter).cost; };
  const Minimum late = minimiseLate(cost);
  if (!late.is_inside || fitAt(late.late_s, scatter).failing >= kMostFailing)
    return;
  constexpr double kSameClock = 4, kNoWorse = 9; // gyro and odometry often come from one computer
  const double with_gyro = cost(m_result.gyro_late_s), least = cost(late.late_s);
  const bool shares_clock =
      m_result.gyro_late_s != 0 && cost(0) - with_gyro > kSameClock && with_gyro - least < kNoWorse;
  const double late_s = shares_clock ? m_result.gyro_late_s : late.late_s;
  const bool is_late = shares_clock || (late.gain > kBetter && std::abs(late.late_s) > kLeastLate_s);
  addConstant("odometry_late_s", late_s, late.sigma_s, is_late,
              fmt::format("odometry: clock {:.0f} +- {:.0f} ms {}{}", 1e3 * std::abs(late_s),
                          std::ceil(1e3 * late.sigma_s), late_s > 0 ? "late" : "early",
                          shares_clock ? ", as the gyro's" : ""));
  if (is_late)
    m_result.odometry_late_s = late_s;
}

/// The frames as they would be read now, each with what points say of it.
template <typename Take> void Estimation::replay(const Take &take) const
{
  const std::vector<Frame> frames = corrected(m_frames, m_result);
  std::size_t next = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    std::vector<RelativeMotion> seen;
    for (; next < m_motions.size() && m_motions[next].b_index == i; ++next)
      seen.push_back(m_motions[next]);
    take(frames[i], seen);
  }
}

/// Reports a sensor that contradicts the others from the start on and that no constant explains.
void Estimation::judge()
{
  constexpr double kAtOnce_s = 1.5;
  SensorMonitor monitor(m_bMc);
  replay([&](const Frame &frame, const std::vector<RelativeMotion> &seen) { monitor.process(frame, seen); });
  for (const SensorVerdict &verdict : monitor.verdicts())
    for (const Sensor sensor : {Sensor::gyro, Sensor::odometry})
      if (verdict.sensor == toString(sensor) && !monitor.trusts(sensor) && verdict.kind != "jump" &&
          verdict.kind != "ended" && verdict.kind != "stuck" &&
          verdict.since_s < secondsOf(m_frames.front().stamp_ns) + kAtOnce_s)
        m_result.verdicts.push_back(verdict);
}

void Estimation::calibrateScale()
{
  InertialScale inertial(m_bMc, m_gyro, kMostScale);
  replay([&](const Frame &frame, const std::vector<RelativeMotion> &seen) { inertial.process(frame, seen); });
  const std::optional<LogScale> measured = inertial.scale(kMostScale);
  if (!measured || std::abs(measured->mean) > kMostScale)
    return;
  const auto density = [&](double prior_sigma) {
    const double variance = std::pow(measured->sigma, 2) + prior_sigma * prior_sigma;
    return std::exp(-0.5 * measured->mean * measured->mean / variance) / std::sqrt(variance);
  };
  const bool is_scaled = kWidePart * density(kWideScale) > (1 - kWidePart) * density(kScale);
  addConstant("odometry_scale", std::exp(measured->mean), measured->sigma, is_scaled,
              fmt::format("odometry: scale {:.3f} +- {:.3f}", std::exp(measured->mean), measured->sigma));
  if (!is_scaled)
    return;
  m_result.odometry_scale = std::exp(measured->mean);
  m_result.odometry_scale_sigma = measured->sigma;
}
} // namespace
} // namespace calibration

SensorCalibrator::SensorCalibrator(const Pose &bMc, const GyroOptions &gyro) : m_bMc(bMc), m_gyro(gyro) {}

void SensorCalibrator::add(const Frame &frame, const std::optional<RelativeMotion> &motion)
{
  Frame kept;
  kept.stamp_ns = frame.stamp_ns;
  kept.index = m_frames.size();
  kept.wMb_odometry = frame.wMb_odometry;
  kept.gyro = frame.gyro;
  m_frames.push_back(std::move(kept));
  if (motion)
    m_motions.push_back(*motion);
}

double SensorCalibrator::duration_s() const
{
  return m_frames.empty() ? 0 : secondsOf(m_frames.back().stamp_ns - m_frames.front().stamp_ns);
}

SensorCalibration SensorCalibrator::estimate() const
{
  if (m_frames.size() < calibration::kLeastMotions)
    return {};
  return calibration::Estimation(m_frames, m_motions, m_bMc, m_gyro).run();
}

SensorCalibration calibrateSensors(FrameSource &source, bool use_gyro, bool use_odometry)
{
  if (!(use_gyro && source.hasGyro()) && !(use_odometry && source.hasOdometry()))
    return {};
  SensorCalibrator calibrator(source.bMc());
  const PinholeCamera camera = source.camera();
  PointTracker tracker(camera);
  struct Tracked
  {
    std::int64_t stamp_ns;
    std::size_t index;
  };
  std::vector<Tracked> tracked;
  Frame frame;
  for (std::size_t index = 0; calibrator.duration_s() < calibration::kLooksThrough_s && source.next(frame); ++index) {
    // an image that contradicts the gyro is the one that is asked
    const bool is_seen = (frame.status == FrameStatus::ok || frame.status == FrameStatus::doubtful) &&
                         frame.image.getWidth() == static_cast<unsigned>(camera.width) &&
                         frame.image.getHeight() == static_cast<unsigned>(camera.height);
    std::optional<RelativeMotion> motion;
    if (is_seen) {
      tracker.track(frame.image);
      tracked.push_back({frame.stamp_ns, index});
      int back = 1;
      while (back < std::min<int>(PointTracker::kHistory, static_cast<int>(tracked.size())) - 1 &&
             secondsOf(frame.stamp_ns - (tracked.rbegin() + back)->stamp_ns) < calibration::kBaseline_s)
        ++back;
      if (back < static_cast<int>(tracked.size())) {
        const Tracked &a = *(tracked.rbegin() + back);
        motion.emplace();
        motion->frames_back = back;
        motion->a_ns = a.stamp_ns;
        motion->b_ns = frame.stamp_ns;
        motion->a_index = a.index;
        motion->b_index = index;
        motion->points = motion->estimate = estimateRelativePose(tracker.matches(back), camera);
      }
    }
    if (!use_gyro)
      frame.gyro.clear();
    if (!use_odometry)
      frame.wMb_odometry.reset();
    calibrator.add(frame, motion);
  }
  return calibrator.estimate();
}
} // namespace bole
