// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/sensor_calibration.h"

#include "geometry/constants.h"
#include "motion/calibration_fit.h"
#include "motion/camera_gyro.h"
#include "motion/gravity.h"
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
constexpr std::size_t kLeastMotions = 15;

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
  Estimation(const std::vector<Frame> &frames, const std::vector<RelativeMotion> &motions, const Pose &bMc)
      : m_frames(frames), m_motions(motions), m_bMc(bMc), m_samples(samplesOf(frames))
  {
    for (const RelativeMotion &motion : motions) {
      if (!motion.points.hasRotation())
        continue;
      Turn turn;
      turn.a_ns = motion.a_ns;
      turn.b_ns = motion.b_ns;
      turn.aRb = bMc.R * motion.points.aRb * bMc.R.transpose();
      const double white = std::pow(kPointsSigma, 2) + std::pow(m_gyro.noise_density, 2) * turn.duration();
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
      calibrateAttitude();
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
  using AttitudeRow = RowOf<6>; ///< bRo, bias of the accelerometer
  struct Attitude
  {
    Matrix3d bRo = Matrix3d::Identity();
    Vector3d force_bias = Vector3d::Zero();
    FittedOf<6> fit; ///< about these
    double cost = 0; ///< with that of the priors
    AttitudeRow::Unknowns value() const { return (AttitudeRow::Unknowns() << logSo3(bRo), force_bias).finished(); }
  };

  void calibrateGyro();
  std::optional<Attitude> fitAttitude(double mount_sigma, double bias_sigma, double scatter) const;
  void calibrateAttitude();
  void calibrateOdometryClock();
  void calibrateScale();
  void judge();
  template <typename Take> void replay(const Take &take) const;
  void addDirections(const std::vector<Frame> &frames, std::vector<AttitudeRow> &rows) const;
  void addGravity(const std::vector<Frame> &frames, std::vector<AttitudeRow> &rows) const;
  template <int P>
  void addTurns(const std::vector<Frame> &frames, const GyroTurns &gyro, double late_s,
                std::vector<RowOf<P>> &rows) const;

  void addConstant(const char *name, double value, double sigma, bool used, std::string text)
  {
    m_result.constants.push_back({name, value, sigma, used, std::move(text)});
  }

  const std::vector<Frame> &m_frames;
  const std::vector<RelativeMotion> &m_motions;
  Pose m_bMc;
  const GyroOptions m_gyro;
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
  std::vector<GyroSample> samples = m_samples; // less the bias
  GyroTurns gyro(samples);
  std::vector<Turn> turns;                  // that every offset can be tried on
  for (int round = 0; round < 2; ++round) { // the second one with the bias taken off exactly
    turns.clear();
    for (const Turn &turn : m_turns)
      if (gyro.between(turn.a_ns - nsOf(kMostLate_s), turn.b_ns + nsOf(kMostLate_s)))
        turns.push_back(turn);
    if (turns.size() < kLeastMotions)
      return;
    const auto fitAt = [&](double late_s, double scatter) { return fitBias(gyro, turns, late_s, m_overlap, scatter); };
    const double scatter = leastScatter(fitAt);
    late = minimiseLate([&](double late_s) { return fitAt(late_s, scatter).cost; });
    fit = fitAt(late.is_inside ? late.late_s : 0, scatter);
    bias += fit.value;
    for (GyroSample &sample : samples)
      sample.rate -= fit.value;
    gyro = GyroTurns(samples);
  }
  m_result.verdicts = judgeCamera(gyro, turns, m_bMc.R, m_overlap);
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
void Estimation::addDirections(const std::vector<Frame> &frames, std::vector<AttitudeRow> &rows) const
{
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
        0.5 * motion.points.covariance.bottomRightCorner<2, 2>().trace() + odometry::directionVariance(length, dt);
    Matrix23d across;
    across.row(0) = by_points.unitOrthogonal().transpose();
    across.row(1) = by_points.cross(Vector3d(across.row(0))).transpose();
    rows.emplace_back(Matrix23d(-across * skew(by_odometry)), Eigen::Vector2d(across * (by_odometry - by_points)),
                      Eigen::Matrix2d(Eigen::Matrix2d::Identity() / variance), m_overlap);
  }
}

/// Gravity, in three parts of the time: the mean force, less the bias and turned by the odometry, is up.
void Estimation::addGravity(const std::vector<Frame> &frames, std::vector<AttitudeRow> &rows) const
{
  constexpr std::size_t kParts = 3;
  const std::vector<GyroSample> samples = samplesOf(frames);
  for (std::size_t part = 0; part < kParts; ++part) {
    Trajectory poses;
    for (std::size_t i = part * (frames.size() - 1) / kParts; i <= (part + 1) * (frames.size() - 1) / kParts; ++i) {
      if (!frames[i].wMb_odometry)
        return;
      poses.push_back({frames[i].stamp_ns, *frames[i].wMb_odometry});
    }
    const auto gravity = compareGravity(poses, samples);
    if (!gravity)
      return;
    Eigen::Matrix<double, 3, 6> J;
    J << gravity->by_rotation, gravity->by_bias;
    const double sigma = std::hypot(gravity->sigma, kGravity * accelerometer::kTiltSigma);
    rows.emplace_back(J, gravity->off, Matrix3d(Matrix3d::Identity() / (sigma * sigma)), 1.0);
  }
}

/// Rotations over half a second: bRo carries those of the odometry to those of the gyro.
template <int P>
void Estimation::addTurns(const std::vector<Frame> &frames, const GyroTurns &gyro, double late_s,
                          std::vector<RowOf<P>> &rows) const
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
    const auto turned = gyro.between(frames[a].stamp_ns - nsOf(late_s), frames[b].stamp_ns - nsOf(late_s));
    if (!turned)
      continue;
    const Vector3d by_gyro = logSo3(*turned);
    const Vector3d by_odometry =
        logSo3(orthonormalized(frames[a].wMb_odometry->R.transpose() * frames[b].wMb_odometry->R));
    const double dt = secondsOf(frames[b].stamp_ns - frames[a].stamp_ns);
    const double variance = odometry::kTurnSigma * odometry::kTurnSigma + std::pow(m_gyro.bias_sigma * dt, 2);
    rows.emplace_back(Matrix3d(-skew(by_odometry)), Vector3d(by_odometry - by_gyro),
                      Matrix3d(Matrix3d::Identity() / variance), kShared);
  }
}

/// The attitude under priors of these widths; nothing where images do not bear witness.
std::optional<Estimation::Attitude> Estimation::fitAttitude(double mount_sigma, double bias_sigma, double scatter) const
{
  AttitudeRow::Unknowns prior2;
  prior2 << Vector3d::Constant(mount_sigma * mount_sigma), Vector3d::Constant(bias_sigma * bias_sigma);
  Attitude attitude;
  for (int round = 0; round < 4; ++round) {
    SensorCalibration tried = m_result;
    tried.bRo = attitude.bRo;
    tried.force_bias = attitude.force_bias;
    const std::vector<Frame> frames = corrected(m_frames, tried);
    std::vector<AttitudeRow> rows;
    addDirections(frames, rows);
    if (rows.size() < kLeastMotions)
      return std::nullopt;
    addGravity(frames, rows);
    addTurns(frames, GyroTurns(samplesOf(frames)), 0, rows);
    attitude.fit = solve(rows, prior2, scatter, attitude.value());
    attitude.bRo = expSo3(attitude.fit.value.head<3>()) * attitude.bRo;
    attitude.force_bias += attitude.fit.value.tail<3>();
  }
  attitude.cost = attitude.fit.cost + attitude.value().cwiseAbs2().cwiseQuotient(prior2).sum();
  return attitude;
}

/// Gravity contradicts an odometry that is turned and an accelerometer that is off alike. Directions of flight and
/// turns show the first, where they can; where they cannot it is the accelerometer, which costs the map nothing.
void Estimation::calibrateAttitude()
{
  constexpr double kTurned = 1.5 * kBetter; // that a turned odometry must explain more
  constexpr double kMost = 3;               // standard deviations
  const std::optional<Attitude> open = fitAttitude(kWideMount, accelerometer::kFaultSigma, 0);
  if (!open || open->fit.failing >= kMostFailing)
    return;
  std::optional<Attitude> best;
  bool is_turned = false, is_biased = false;
  for (const bool turned : {false, true})
    for (const bool biased : {false, true}) {
      std::optional<Attitude> tried =
          fitAttitude(turned ? kWideMount : kMount, biased ? accelerometer::kFaultSigma : accelerometer::kBiasSigma,
                      open->fit.scatter);
      tried->cost += (turned ? kTurned : 0) + (biased ? kBetter : 0);
      const bool is_likely = tried->force_bias.norm() < kMost * accelerometer::kFaultSigma;
      if (best && (tried->cost >= best->cost || !is_likely)) // more is another fault
        continue;
      best = tried;
      is_turned = turned;
      is_biased = biased;
    }
  const auto sigmaOf = [](const auto &covariance) { return std::sqrt(covariance.trace() / 3); };
  const Attitude &turn = is_turned ? *best : *open, &bias = is_biased ? *best : *open;
  const Vector3d rotation = logSo3(turn.bRo);
  const double turn_sigma = sigmaOf(turn.fit.covariance.topLeftCorner<3, 3>()),
               bias_sigma = sigmaOf(bias.fit.covariance.bottomRightCorner<3, 3>());
  addConstant("odometry_rotation", rotation.norm(), turn_sigma, is_turned,
              fmt::format("odometry: body turned by {:.1f} +- {:.1f} degrees (roll {:.1f}, pitch {:.1f}, yaw {:.1f})",
                          rotation.norm() / kDegree, turn_sigma / kDegree, rotation.x() / kDegree,
                          rotation.y() / kDegree, rotation.z() / kDegree));
  if (bias_sigma < 0.5 * accelerometer::kFaultSigma) // else nothing measured it
    addConstant("accelerometer_bias", bias.force_bias.norm(), bias_sigma, is_biased,
                fmt::format("accelerometer: off by {:.2f} +- {:.2f} m/s^2", bias.force_bias.norm(), bias_sigma));
  if (is_biased)
    m_result.force_bias = best->force_bias;
  if (is_turned) {
    m_result.bRo = best->bRo;
    m_result.odometry_rotation_sigma = turn_sigma;
  }
}

void Estimation::calibrateOdometryClock()
{
  const std::vector<Frame> frames = corrected(m_frames, m_result);
  const GyroTurns gyro(samplesOf(frames));
  std::vector<Frame> usable; // that every offset can be tried on
  for (const Frame &frame : frames)
    if (gyro.between(frame.stamp_ns - nsOf(kMostLate_s), frame.stamp_ns + nsOf(kMostLate_s)))
      usable.push_back(frame);
  if (usable.size() < 2 * kLeastMotions)
    return;
  const auto fitAt = [&](double late_s, double scatter) {
    std::vector<Row> rows;
    addTurns(usable, gyro, late_s, rows);
    return solve(rows, kWideMount * kWideMount, scatter); // whatever its body stands like
  };
  const double scatter = leastScatter(fitAt);
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
  bool is_constant = true; // the accelerometer's bias: what is left of so short a time tells no scale
  replay([&](const Frame &frame, const std::vector<RelativeMotion> &seen) {
    inertial.process(frame, seen);
    is_constant = is_constant && !inertial.hasBegunAnew();
  });
  const std::optional<LogScale> measured = inertial.scale(kMostScale);
  if (!measured || !is_constant || std::abs(measured->mean) > kMostScale)
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

SensorCalibration calibrate(const std::vector<Frame> &frames, const std::vector<RelativeMotion> &motions,
                            const Pose &bMc)
{
  if (frames.size() < calibration::kLeastMotions)
    return {};
  return calibration::Estimation(frames, motions, bMc).run();
}

SensorCalibration calibrateSensors(FrameSource &source, bool use_gyro, bool use_odometry)
{
  constexpr std::size_t kLensEvery = 8; // motions that the lens is judged by: a frame is in one of them
  const PinholeCamera camera = source.camera();
  PointTracker tracker(camera);
  std::vector<Frame> frames; // without images
  std::vector<RelativeMotion> motions;
  std::vector<std::vector<PointMatch>> pairs;
  std::vector<std::size_t> tracked;
  const auto sinceFrame = [&frames](std::size_t a) { return secondsOf(frames.back().stamp_ns - frames[a].stamp_ns); };
  for (Frame frame; (frames.empty() || sinceFrame(0) < calibration::kLooksThrough_s) && source.next(frame);) {
    Frame kept;
    kept.stamp_ns = frame.stamp_ns;
    kept.index = frames.size();
    if (use_odometry)
      kept.wMb_odometry = frame.wMb_odometry;
    if (use_gyro)
      kept.gyro = frame.gyro;
    frames.push_back(std::move(kept));
    // an image that contradicts the gyro is the one that is asked
    const bool is_seen = (frame.status == FrameStatus::ok || frame.status == FrameStatus::doubtful) &&
                         frame.image.getWidth() == static_cast<unsigned>(camera.width) &&
                         frame.image.getHeight() == static_cast<unsigned>(camera.height);
    if (!is_seen)
      continue;
    tracker.track(frame.image);
    tracked.push_back(frames.size() - 1);
    const int most = std::min<int>(PointTracker::kHistory, static_cast<int>(tracked.size())) - 1;
    if (most < 1)
      continue;
    int back = 1;
    while (back < most && sinceFrame(tracked.rbegin()[back]) < calibration::kBaseline_s)
      ++back;
    RelativeMotion motion;
    motion.frames_back = back;
    motion.a_index = tracked.rbegin()[back];
    motion.b_index = tracked.back();
    motion.a_ns = frames[motion.a_index].stamp_ns;
    motion.b_ns = frame.stamp_ns;
    std::vector<PointMatch> matches = tracker.matches(back);
    motion.points = estimateRelativePose(matches, camera);
    motions.push_back(motion);
    if (motions.size() % kLensEvery == 0 && motion.points.hasDirection())
      pairs.push_back(std::move(matches));
  }
  if (const auto k1 = calibration::findDistortion(pairs, camera)) { // whatever else is measured rests on the camera
    SensorCalibration as_stated;
    as_stated.verdicts.push_back(
        {"images", "lens", secondsOf(frames.front().stamp_ns),
         fmt::format("images: the lens bends them otherwise than told, by about k1 = {:+.2f}", *k1)});
    return as_stated;
  }
  if (!(use_gyro && source.hasGyro()) && !(use_odometry && source.hasOdometry()))
    return {};
  return calibrate(frames, motions, source.bMc());
}
} // namespace bole
