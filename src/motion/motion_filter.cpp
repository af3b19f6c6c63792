// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/motion_filter.h"

#include "geometry/constants.h"
#include "motion/motion_filter_states.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using namespace motion_states;

namespace
{
// What is not measured walks: white acceleration and angular acceleration of a small drone.
constexpr double kAcceleration = 2;     // [m/s^2/sqrt(Hz)]
constexpr double kTurning = 1;          // [rad/s^2/sqrt(Hz)]
constexpr double kManoeuvre = 10;       // times that, where two sensors say so
constexpr double kMountWalk = 1e-3;     // of the odometry's attitude error [rad/sqrt(s)]
constexpr double kScaleWalk = 2e-3;     // of the log of the odometry's scale [1/sqrt(s)]
constexpr double kHeightWalk = 0.05;    // of a barometer [m/sqrt(s)]
constexpr double kStartSpeed = 5;       // [m/s]
constexpr double kStartRate = 1;        // [rad/s]
constexpr double kStartTilt = 0.02;     // by the first pose of the odometry [rad]
constexpr double kNoTilt = 0.3;         // without one [rad]
constexpr double kLeastGyroBias = 0.03; // that a gyro may begin with [rad/s]
constexpr double kForceBias = 0.2;      // [m/s^2]
constexpr double kMountTilt = 0.012; // of the odometry's body against ours: an accelerometer's bias looks alike [rad]
constexpr double kMountYaw = 0.04;   // [rad]
constexpr double kScale = 0.1;       // of the log
constexpr double kLowest = -2, kHighest = 10; // where it begins [m]: it may count from the body at take-off
constexpr double kUsualHeight = 1.5;          // for one that begins elsewhere [m]
constexpr double kHeight = 0.05;              // [m]

constexpr double kMemory_s = 1;    // of the mean misfit
constexpr double kMostMisfit = 20; // a row, in the mean

constexpr double kKept_s = 0.36; // of the poses before
constexpr std::size_t kLeastKept = 4, kMostKept = 24;

void setBlock(MatrixXd &P, int at, double variance) { P.diagonal().segment<3>(at).setConstant(variance); }

/// White noise that is integrated once in \p rate and twice in \p value.
void addWalk(MatrixXd &P, int value, int rate, double density, double dt)
{
  const double q = density * density;
  for (int k = 0; k < 3; ++k) {
    P(value + k, value + k) += q * dt * dt * dt / 3;
    P(rate + k, rate + k) += q * dt;
    P(value + k, rate + k) += q * dt * dt / 2;
    P(rate + k, value + k) += q * dt * dt / 2;
  }
}
} // namespace

MotionFilter::MotionFilter(const Pose &bMc, const GyroOptions &gyro, std::size_t first)
    : m_bMc(bMc), m_gyro(gyro), m_number(first), m_covariance(MatrixXd::Zero(kCore, kCore))
{
}

void MotionFilter::begin(const Frame &frame)
{
  m_has_begun = true;
  MatrixXd &P = m_covariance;
  const bool has_pose = frame.wMb_odometry.has_value();
  if (has_pose) {
    m_wRb = frame.wMb_odometry->R;
    m_place = frame.wMb_odometry->t;
    if (m_place.z() < kLowest || m_place.z() > kHighest) {
      raise(Source::odometry_height, "height", secondsOf(frame.stamp_ns),
            fmt::format("odometry: its heights begin at {:.1f} m, must be over the ground (over the sea?): {:.1f} m is "
                        "taken for it",
                        m_place.z(), kUsualHeight));
      m_height = m_place.z() - kUsualHeight;
      m_place.z() = kUsualHeight;
    }
  }
  const double tilt = has_pose ? kStartTilt : kNoTilt;
  setBlock(P, kAttitudeAt, tilt * tilt);
  setBlock(P, kPlaceAt, 1e-6);
  setBlock(P, kVelocityAt, kStartSpeed * kStartSpeed);
  setBlock(P, kRateAt, kStartRate * kStartRate);
  setBlock(P, kGyroAt, std::pow(std::max(kLeastGyroBias, m_gyro.bias_sigma), 2));
  setBlock(P, kForceAt, kForceBias * kForceBias);
  P.diagonal().segment<3>(kMountAt) = Vector3d(kMountTilt, kMountTilt, kMountYaw).cwiseAbs2();
  P(kScaleAt, kScaleAt) = kScale * kScale;
  P(kHeightAt, kHeightAt) = kHeight * kHeight;
}

const Frame &MotionFilter::expect(const Frame &frame, Frame &room)
{
  m_step.reset();
  m_free_step.reset();
  m_rows.clear();
  m_is_out.fill(false);
  if (!m_has_begun) {
    begin(frame);
    return frame;
  }
  const double dt = secondsOf(frame.stamp_ns - m_stamp_ns);
  m_dt = dt > 0 ? dt : m_usual_dt; // a stamp that goes back tells no time
  collect(frame);
  m_inertial = integrate(frame, dt);
  m_free_step = stepFrom(m_inertial, m_dt);
  predict(m_dt);
  m_rows = measure(frame);
  leaveOutHeld(frame, {});
  m_is_out = judge(m_rows).is_out;
  return believed(frame, room);
}

void MotionFilter::process(const Frame &frame, const std::vector<RelativeMotion> &motions)
{
  for (const RelativeMotion &motion : motions)
    if (motion.points.hasRotation())
      addPoints(motion, m_rows);
  leaveOutHeld(frame, motions);
  const Judged judged = judgeOrSwerve();
  m_is_out = judged.is_out;
  const double weight = 1 - std::exp(-m_dt / kMemory_s);
  for (std::size_t s = 0; s < kSources; ++s) {
    if (judged.misfit[s] >= 0)
      m_misfit[s] += weight * (std::min(kMostMisfit, judged.misfit[s]) - m_misfit[s]);
    m_out[s] += weight * (double(m_is_out[s]) - m_out[s]);
  }
  name(frame);
  m_rows.erase(
      std::remove_if(m_rows.begin(), m_rows.end(), [this](const Rows &rows) { return !believes(rows.source); }),
      m_rows.end());
  if (!m_rows.empty())
    update(m_rows);
  if (!believes(Source::odometry_step))
    m_step.reset();
  if (m_step)
    climbAsFiltered(*m_step);
  remember(frame);
  ++m_number;
}

/// A pose filter's height is that of a sonar or a barometer: noise in each frame, and it wanders.
void MotionFilter::climbAsFiltered(OdometryStep &step) const
{
  const Clone &a = m_clones[step.a - m_clones.front().number];
  Vector3d moved = a.wRb * step.aMb.t;
  moved.z() = m_place.z() - a.place.z();
  step.aMb.t = a.wRb.transpose() * moved;
}

/// Where two sensors or more contradict the prediction, it may be the body that swerved.
MotionFilter::Judged MotionFilter::judgeOrSwerve()
{
  const auto sensorsOut = [](const Judged &one) {
    const auto out = [&](Source source) { return one.is_out[static_cast<std::size_t>(source)]; };
    return int(out(Source::gyro) || out(Source::accelerometer)) +
           int(out(Source::odometry_turn) || out(Source::odometry_step)) + int(out(Source::points));
  };
  const Judged judged = judge(m_rows);
  if (sensorsOut(judged) < 2)
    return judged;
  const MatrixXd before = m_covariance;
  const double dt = std::max(m_dt, m_usual_dt);
  addWalk(m_covariance, kPlaceAt, kVelocityAt, kManoeuvre * kAcceleration, dt);
  addWalk(m_covariance, kAttitudeAt, kRateAt, kManoeuvre * kTurning, dt);
  const Judged swerved = judge(m_rows);
  if (sensorsOut(swerved) < sensorsOut(judged))
    return swerved;
  m_covariance = before;
  return judged;
}

void MotionFilter::predict(double dt)
{
  const Matrix3d turn = expSo3(m_rate * dt);
  const auto advance = [&] { // the rows of the covariance
    m_covariance.middleRows<3>(kAttitudeAt) =
        (turn.transpose() * m_covariance.middleRows<3>(kAttitudeAt) + dt * m_covariance.middleRows<3>(kRateAt)).eval();
    m_covariance.middleRows<3>(kPlaceAt) += dt * m_covariance.middleRows<3>(kVelocityAt);
  };
  advance();
  m_covariance.transposeInPlace(); // F P F^T = F (F P)^T
  advance();
  addWalk(m_covariance, kPlaceAt, kVelocityAt, kAcceleration, dt);
  addWalk(m_covariance, kAttitudeAt, kRateAt, kTurning, dt);
  const auto white = [&](int at, double density) {
    m_covariance.diagonal().segment<3>(at).array() += density * density * dt;
  };
  white(kGyroAt, m_gyro.bias_walk);
  white(kForceAt, accelerometer::kBiasWalk);
  white(kMountAt, kMountWalk);
  m_covariance(kScaleAt, kScaleAt) += kScaleWalk * kScaleWalk * dt;
  m_covariance(kHeightAt, kHeightAt) += kHeightWalk * kHeightWalk * dt;
  m_place += dt * m_velocity;
  m_wRb = orthonormalized(m_wRb * turn);
}

/// Whether the samples say anything: an accelerometer that is not there may be written as one value.
void MotionFilter::collect(const Frame &frame)
{
  bool varies = frame.gyro.empty();
  for (const GyroSample &sample : frame.gyro) {
    varies |= m_last_sample && sample.rate != m_last_sample->rate;
    if (!sample.force)
      continue;
    if (!m_first_force)
      m_first_force = sample.force;
    m_force_varies = m_force_varies || *m_first_force != *sample.force;
  }
  m_same_rates = varies ? 0 : m_same_rates + 1;
}

/// A pose that is repeated while the body moves is no measurement.
void MotionFilter::leaveOutHeld(const Frame &frame, const std::vector<RelativeMotion> &motions)
{
  m_is_held = isHeld(frame, motions);
  if (m_is_held)
    m_rows.erase(std::remove_if(m_rows.begin(), m_rows.end(), [](const Rows &rows) { return isOdometry(rows.source); }),
                 m_rows.end());
}

bool MotionFilter::isHeld(const Frame &frame, const std::vector<RelativeMotion> &motions) const
{
  constexpr double kMoves_px = 1, kMoves = 0.05; // [m/s]
  if (m_clones.empty() || !frame.wMb_odometry || !m_clones.back().odometry ||
      m_clones.back().odometry->t != frame.wMb_odometry->t || m_clones.back().odometry->R != frame.wMb_odometry->R)
    return false;
  const double sigma = std::sqrt(m_covariance.diagonal().segment<3>(kVelocityAt).maxCoeff());
  return m_velocity.norm() > kMoves + 3 * sigma ||
         std::any_of(motions.begin(), motions.end(), [](const RelativeMotion &motion) {
           return motion.points.hasDirection() && motion.points.parallax_px > kMoves_px;
         });
}

/// Kalman's update by all that is believed.
void MotionFilter::update(const std::vector<Rows> &rows)
{
  Eigen::Index count = 0;
  for (const Rows &one : rows)
    count += one.residual.size();
  MatrixXd H(count, m_covariance.cols()), noise = MatrixXd::Zero(count, count);
  VectorXd residual(count);
  Eigen::Index at = 0;
  for (const Rows &one : rows) {
    const Eigen::Index n = one.residual.size();
    H.middleRows(at, n) = one.H;
    noise.block(at, at, n, n) = one.noise;
    residual.segment(at, n) = one.residual;
    at += n;
  }
  const MatrixXd PHt = m_covariance * H.transpose();
  const Eigen::LLT<MatrixXd> S(H * PHt + noise);
  const VectorXd change = PHt * S.solve(residual);
  const MatrixXd root = S.matrixL().solve(PHt.transpose());
  m_covariance.noalias() -= root.transpose() * root;
  m_covariance = (0.5 * (m_covariance + m_covariance.transpose())).eval();
  m_wRb = m_wRb * expSo3(change.segment<3>(kAttitudeAt));
  m_place += change.segment<3>(kPlaceAt);
  m_velocity += change.segment<3>(kVelocityAt);
  m_rate += change.segment<3>(kRateAt);
  m_gyro_bias += change.segment<3>(kGyroAt);
  m_force_bias += change.segment<3>(kForceAt);
  m_bRo = m_bRo * expSo3(change.segment<3>(kMountAt));
  m_log_scale += change(kScaleAt);
  m_height += change(kHeightAt);
  for (Clone &clone : m_clones) {
    const Eigen::Index column = columnOf(clone);
    clone.wRb = clone.wRb * expSo3(change.segment<3>(column));
    clone.place += change.segment<3>(column + 3);
  }
}

/// The pose of the frame becomes the newest of those that later ones are compared with.
void MotionFilter::remember(const Frame &frame)
{
  const auto isOld = [&](const Clone &clone) {
    return m_clones.size() >= kLeastKept &&
           (m_clones.size() >= kMostKept || secondsOf(frame.stamp_ns - clone.stamp_ns) > kKept_s);
  };
  std::size_t gone = 0;
  while (m_clones.size() > gone && isOld(m_clones[gone]) && m_clones.size() - gone >= kLeastKept)
    ++gone;
  const Eigen::Index kept = Eigen::Index(6 * (m_clones.size() - gone));
  const Eigen::Index skipped = Eigen::Index(6 * gone);
  std::vector<Eigen::Index> from; // rows of the covariance before
  for (Eigen::Index k = 0; k < kLastVelocityAt; ++k)
    from.push_back(k);
  for (Eigen::Index k = 0; k < 3; ++k)
    from.push_back(kVelocityAt + k);
  for (Eigen::Index k = 0; k < kept; ++k)
    from.push_back(kCore + skipped + k);
  for (Eigen::Index k = 0; k < 6; ++k)
    from.push_back(kAttitudeAt + k);
  const auto n = Eigen::Index(from.size());
  MatrixXd P(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      P(i, j) = m_covariance(from[std::size_t(i)], from[std::size_t(j)]);
  m_covariance = std::move(P);
  m_clones.erase(m_clones.begin(), m_clones.begin() + std::ptrdiff_t(gone));
  m_clones.push_back({m_number, frame.stamp_ns, m_wRb, m_place, frame.wMb_odometry, believes(Source::odometry_step)});
  m_last_velocity = m_velocity;
  const double dt = secondsOf(frame.stamp_ns - m_stamp_ns);
  if (m_clones.size() > 1 && dt > 0 && dt < 1)
    m_usual_dt = 0.8 * m_usual_dt + 0.2 * dt;
  m_stamp_ns = frame.stamp_ns;
  if (!frame.gyro.empty())
    m_last_sample = frame.gyro.back();
}

Eigen::Index MotionFilter::columnOf(const Clone &clone) const
{
  return kCore + 6 * Eigen::Index(clone.number - m_clones.front().number);
}

const Frame &MotionFilter::believed(const Frame &frame, Frame &room) const
{
  const bool has_step = believes(Source::odometry_step), has_gyro = believes(Source::gyro);
  if (has_gyro && has_step)
    return frame;
  room = frame;
  if (!has_gyro)
    room.gyro.clear();
  if (!has_step)
    room.wMb_odometry.reset();
  return room;
}

std::optional<Pose> MotionFilter::odometryPose(const Frame &frame) const
{
  if (!frame.wMb_odometry)
    return std::nullopt;
  return Pose(frame.wMb_odometry->R, frame.wMb_odometry->t - Vector3d(0, 0, m_height));
}

GyroBias MotionFilter::gyroBias() const { return {m_gyro_bias, m_covariance.block<3, 3>(kGyroAt, kGyroAt)}; }

std::optional<LogScale> MotionFilter::measuredScale() const
{
  constexpr double kLearnt = 0.7; // of the standard deviation that may be left
  const double sigma = logScaleSigma();
  if (sigma > kLearnt * kScale)
    return std::nullopt;
  const double information = 1 / (sigma * sigma) - 1 / (kScale * kScale);
  return LogScale{m_log_scale / (sigma * sigma) / information, 1 / std::sqrt(information)};
}

double MotionFilter::logScaleSigma() const { return std::sqrt(m_covariance(kScaleAt, kScaleAt)); }
} // namespace bole
