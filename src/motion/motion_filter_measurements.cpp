// SPDX-License-Identifier: GPL-2.0-or-later
// What each sensor measures of the state, and what is said of one that is left out.
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
using namespace motion_states;

namespace
{
const Vector3d kGravityVector(0, 0, -kGravity); // [m/s^2]

constexpr double kGyroRelative = 0.01;                    // of a turn: scale and axes of a gyro
constexpr double kRateNoise = 0.03;                       // of the rate at a stamp [rad/s]
constexpr double kForceNoise = 2 * accelerometer::kNoise; // with the vibration of a drone [m/s^2/sqrt(Hz)]
constexpr double kForceRelative = 0.01;                   // of a change of velocity: scale and axes of an accelerometer

// The pose filter: measured on the rendered flights, as PointMotionOptions tell.
constexpr double kTurnSigma = 0.007;     // of its rotation between two frames [rad]
constexpr double kTurnWalk = 0.01;       // of its heading [rad/sqrt(s)]
constexpr double kStepWalk = 0.038;      // of its horizontal place [m/sqrt(s)]
constexpr double kStated_s = 0.1;        // for which it is stated
constexpr double kStepRelative = 0.03;   // of its steps
constexpr double kHeightStep = 0.03;     // of the difference of two heights [m]
constexpr double kHeightNoise = 0.02;    // [m]
constexpr double kTiltNoise = 0.006;     // of its roll and pitch [rad]
constexpr double kPointsSigma = 7e-4;    // of a rotation by points beside its own covariance [rad]
constexpr double kLeastDirection = 0.02; // [m]: shorter displacements have no direction
constexpr double kKnownDirection = 3;    // standard deviations of a displacement that has one

Matrix3d isotropic(double variance) { return variance * Matrix3d::Identity(); }
} // namespace

MotionFilter::Inertial MotionFilter::integrate(const Frame &frame, double dt) const
{
  Inertial inertial;
  if (frame.gyro.empty() || dt <= 0)
    return inertial;
  std::vector<GyroSample> samples = frame.gyro;
  if (m_last_sample)
    samples.insert(samples.begin(), *m_last_sample);
  inertial.turn = integrateGyro(samples, m_stamp_ns, frame.stamp_ns, {m_gyro_bias, Matrix3d::Zero()}, m_gyro);
  inertial.has_turn = inertial.turn.complete;
  inertial.rate = samples.back().rate - m_gyro_bias;
  inertial.has_force = inertial.has_turn && m_force_varies &&
                       std::all_of(samples.begin(), samples.end(), [](const GyroSample &s) { return bool(s.force); });
  if (!inertial.has_force)
    return inertial;
  Matrix3d turned = Matrix3d::Identity();
  std::int64_t at_ns = m_stamp_ns;
  const auto advance = [&](const GyroSample &first, const GyroSample &second, std::int64_t end_ns) {
    const double step_s = secondsOf(end_ns - at_ns);
    const Vector3d rate = 0.5 * (first.rate + second.rate) - m_gyro_bias;
    const Vector3d force = turned * expSo3(0.5 * step_s * rate) * (0.5 * (*first.force + *second.force) - m_force_bias);
    inertial.moved += step_s * inertial.velocity + 0.5 * step_s * step_s * force;
    inertial.velocity += step_s * force;
    turned = turned * expSo3(step_s * rate);
    at_ns = end_ns;
  };
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (const std::int64_t end_ns = std::min(samples[i].stamp_ns, frame.stamp_ns); end_ns > at_ns)
      advance(samples[i > 0 ? i - 1 : 0], samples[i], end_ns);
  if (frame.stamp_ns > at_ns)
    advance(samples.back(), samples.back(), frame.stamp_ns);
  inertial.longer = std::max(1.0, accelerometer::kRate * dt / double(frame.gyro.size()));
  return inertial;
}

/// From the last frame, by the velocity there and the accelerometer.
std::optional<FreeStep> MotionFilter::stepFrom(const Inertial &inertial, double dt) const
{
  constexpr double kLasts_s = 2;       // an error of the velocity does not average out for so long
  constexpr double kLeastStep = 0.003; // [m]
  constexpr double kSwerve = 2;        // [m/s^2/sqrt(Hz)] without an accelerometer
  FreeStep step;
  Vector3d moved = m_wRb.transpose() * m_velocity * dt;
  double variance = m_covariance.diagonal().segment<3>(kVelocityAt).mean() * dt * kLasts_s;
  if (inertial.has_force)
    moved += inertial.moved + 0.5 * dt * dt * (m_wRb.transpose() * kGravityVector);
  else
    variance += kSwerve * kSwerve * dt * dt * dt / 3;
  const double scale = std::exp(m_log_scale);
  step.moved = m_wRb.transpose() * Vector3d(scale, scale, 1).cwiseProduct(m_wRb * moved);
  step.sigma = std::hypot(kLeastStep, std::sqrt(variance));
  return step;
}

MotionFilter::Rows MotionFilter::rowsFor(Source source, Eigen::Index count) const
{
  return {source, MatrixXd::Zero(count, m_covariance.cols()), MatrixXd::Zero(count, count),
          Eigen::VectorXd::Zero(count)};
}

std::vector<MotionFilter::Rows> MotionFilter::measure(const Frame &frame)
{
  std::vector<Rows> rows;
  if (m_clones.empty())
    return rows;
  addInertial(rows);
  if (frame.wMb_odometry)
    addOdometry(frame, rows);
  return rows;
}

void MotionFilter::addInertial(std::vector<Rows> &all) const
{
  const Clone &a = m_clones.back();
  const Eigen::Index at = columnOf(a);
  const Matrix3d aRw = a.wRb.transpose();
  if (m_inertial.has_turn) {
    const Matrix3d aRb = aRw * m_wRb;
    Rows rows = rowsFor(Source::gyro, 6);
    rows.residual << logSo3(orthonormalized(aRb.transpose() * m_inertial.turn.R)), m_inertial.rate - m_rate;
    rows.H.block<3, 3>(0, kAttitudeAt).setIdentity();
    rows.H.block<3, 3>(0, at) = -aRb.transpose();
    rows.H.block<3, 3>(0, kGyroAt) = isotropic(m_dt);
    rows.H.block<3, 3>(3, kRateAt).setIdentity();
    rows.H.block<3, 3>(3, kGyroAt).setIdentity();
    const double relative = kGyroRelative * logSo3(m_inertial.turn.R).norm();
    rows.noise.topLeftCorner<3, 3>() = m_inertial.turn.white + isotropic(relative * relative);
    rows.noise.bottomRightCorner<3, 3>() = isotropic(kRateNoise * kRateNoise);
    all.push_back(rows);
  }
  if (m_inertial.has_force) {
    const Vector3d gained = aRw * (m_velocity - m_last_velocity - m_dt * kGravityVector);
    const Vector3d moved = aRw * (m_place - a.place - m_dt * m_last_velocity - 0.5 * m_dt * m_dt * kGravityVector);
    Rows rows = rowsFor(Source::accelerometer, 6);
    rows.residual << m_inertial.velocity - gained, m_inertial.moved - moved;
    rows.H.block<3, 3>(0, kVelocityAt) = aRw;
    rows.H.block<3, 3>(0, kLastVelocityAt) = -aRw;
    rows.H.block<3, 3>(0, at) = skew(gained);
    rows.H.block<3, 3>(0, kForceAt) = isotropic(m_dt);
    rows.H.block<3, 3>(3, kPlaceAt) = aRw;
    rows.H.block<3, 3>(3, at + 3) = -aRw;
    rows.H.block<3, 3>(3, kLastVelocityAt) = -m_dt * aRw;
    rows.H.block<3, 3>(3, at) = skew(moved);
    rows.H.block<3, 3>(3, kForceAt) = isotropic(0.5 * m_dt * m_dt);
    const double q = kForceNoise * kForceNoise * m_inertial.longer;
    const double relative = kForceRelative * (gained + m_dt * aRw * kGravityVector).norm();
    rows.noise.block<3, 3>(0, 0) = isotropic(q * m_dt + relative * relative);
    rows.noise.block<3, 3>(3, 3) = isotropic(q * m_dt * m_dt * m_dt / 3 + std::pow(0.5 * m_dt * relative, 2));
    rows.noise.block<3, 3>(0, 3) = isotropic(0.5 * q * m_dt * m_dt + 0.5 * m_dt * relative * relative);
    rows.noise.block<3, 3>(3, 0) = rows.noise.block<3, 3>(0, 3);
    rows.noise.diagonal().array() += 1e-10;
    all.push_back(rows);
  }
}

MotionFilter::Rows MotionFilter::stepSince(const Clone &a, const Frame &frame) const
{
  const double scale = std::exp(m_log_scale);
  const Vector3d stretch(scale, scale, 1), moved = m_place - a.place;
  const Matrix3d oRa = m_bRo.transpose() * a.wRb.transpose();
  const Vector3d told = a.odometry->R.transpose() * (frame.wMb_odometry->t - a.odometry->t);
  const Vector3d expected = oRa * stretch.cwiseProduct(moved);
  const Eigen::Index at = columnOf(a);
  Rows rows = rowsFor(Source::odometry_step, 3);
  rows.residual = told - expected;
  rows.H.middleCols<3>(kPlaceAt) = oRa * stretch.asDiagonal();
  rows.H.middleCols<3>(at + 3) = -oRa * stretch.asDiagonal();
  rows.H.middleCols<3>(at) = m_bRo.transpose() * skew(a.wRb.transpose() * stretch.cwiseProduct(moved));
  rows.H.middleCols<3>(kMountAt) = skew(expected);
  rows.H.col(kScaleAt) = oRa * Vector3d(scale * moved.x(), scale * moved.y(), 0);
  const double longer = std::max(secondsOf(frame.stamp_ns - a.stamp_ns), m_dt), walk2 = kStepWalk * kStepWalk * longer;
  const double relative = kStepRelative * told.norm() * std::sqrt(kStated_s / longer);
  rows.noise = oRa * Vector3d(walk2, walk2, kHeightStep * kHeightStep).asDiagonal() * oRa.transpose();
  rows.noise += isotropic(relative * relative);
  return rows;
}

MotionFilter::Rows MotionFilter::turnSince(const Clone &a, const Frame &frame) const
{
  const Matrix3d told = a.odometry->R.transpose() * frame.wMb_odometry->R;
  const Matrix3d aRb = a.wRb.transpose() * m_wRb, expected = m_bRo.transpose() * aRb * m_bRo;
  Rows rows = rowsFor(Source::odometry_turn, 3);
  rows.residual = logSo3(orthonormalized(expected.transpose() * told));
  rows.H.middleCols<3>(kAttitudeAt) = m_bRo.transpose();
  rows.H.middleCols<3>(columnOf(a)) = -m_bRo.transpose() * aRb.transpose();
  rows.H.middleCols<3>(kMountAt) = Matrix3d::Identity() - expected.transpose();
  rows.noise = isotropic(kTurnSigma * kTurnSigma + kTurnWalk * kTurnWalk * m_dt);
  return rows;
}

/// The last frame at which the odometry was believed or, if it jumped there for good, the last one that has any.
const MotionFilter::Clone *MotionFilter::anchorFor(const Frame &frame) const
{
  const auto misfit = [&](const Clone &a) {
    const Rows rows = stepSince(a, frame);
    const MatrixXd S = rows.H * m_covariance * rows.H.transpose() + rows.noise;
    return rows.residual.dot(S.ldlt().solve(rows.residual));
  };
  const auto last = std::find_if(m_clones.rbegin(), m_clones.rend(), [](const Clone &c) { return bool(c.odometry); });
  const auto good = std::find_if(m_clones.rbegin(), m_clones.rend(),
                                 [](const Clone &c) { return c.odometry && c.is_odometry_believed; });
  if (last == m_clones.rend())
    return nullptr;
  return good == m_clones.rend() || (good != last && misfit(*last) < misfit(*good)) ? &*last : &*good;
}

void MotionFilter::addOdometry(const Frame &frame, std::vector<Rows> &all)
{
  const Pose &wMo = *frame.wMb_odometry;
  if (const Clone *a = anchorFor(frame)) {
    all.push_back(stepSince(*a, frame));
    all.push_back(turnSince(*a, frame));
    const Pose told = a->odometry->inverse() * wMo;
    m_step = OdometryStep{a->number, Pose(m_bRo * told.R * m_bRo.transpose(), m_bRo * told.t),
                          secondsOf(frame.stamp_ns - a->stamp_ns)};
  }
  const Vector3d up = m_wRb.transpose() * Vector3d::UnitZ(), expected = m_bRo.transpose() * up;
  const Matrix32d basis = directionBasis(expected);
  Rows tilt = rowsFor(Source::odometry_tilt, 2);
  tilt.residual = basis.transpose() * (wMo.R.transpose() * Vector3d::UnitZ() - expected);
  tilt.H.middleCols<3>(kAttitudeAt) = basis.transpose() * m_bRo.transpose() * skew(up);
  tilt.H.middleCols<3>(kMountAt) = basis.transpose() * skew(expected);
  tilt.noise = kTiltNoise * kTiltNoise * Eigen::Matrix2d::Identity();
  all.push_back(tilt);
  Rows height = rowsFor(Source::odometry_height, 1);
  height.residual(0) = wMo.t.z() - m_place.z() - m_height;
  height.H(0, kPlaceAt + 2) = 1;
  height.H(0, kHeightAt) = 1;
  height.noise(0, 0) = kHeightNoise * kHeightNoise;
  all.push_back(height);
}

/// Rotation of the camera and the direction of its displacement. Motions over several frames overlap: each counts in
/// part.
void MotionFilter::addPoints(const RelativeMotion &motion, std::vector<Rows> &all) const
{
  const auto a = std::find_if(m_clones.begin(), m_clones.end(),
                              [&](const Clone &clone) { return clone.number == motion.a_index; });
  if (a == m_clones.end())
    return;
  const Eigen::Index at = columnOf(*a);
  const Matrix3d cRb = m_bMc.R.transpose(), aRb = a->wRb.transpose() * m_wRb;
  const Vector3d shift = a->wRb.transpose() * (m_place - a->place), moved = cRb * (shift + aRb * m_bMc.t - m_bMc.t);
  const Vector3d &direction = motion.points.direction;
  MatrixXd by_moved = MatrixXd::Zero(3, m_covariance.cols()); // of the camera, in its axes at a
  by_moved.middleCols<3>(kPlaceAt) = cRb * a->wRb.transpose();
  by_moved.middleCols<3>(at + 3) = -cRb * a->wRb.transpose();
  by_moved.middleCols<3>(at) = cRb * skew(shift + aRb * m_bMc.t);
  by_moved.middleCols<3>(kAttitudeAt) = -cRb * aRb * skew(m_bMc.t);
  const double length = moved.norm();
  const double sigma = std::sqrt((by_moved * m_covariance * by_moved.transpose()).trace() / 3);
  const bool has_direction = motion.points.hasDirection() &&
                             length > std::max(kLeastDirection, kKnownDirection * sigma) && direction.dot(moved) > 0;
  Rows rows = rowsFor(Source::points, has_direction ? 5 : 3);
  const Matrix3d expected = cRb * aRb * m_bMc.R;
  rows.residual.head<3>() = logSo3(orthonormalized(expected.transpose() * motion.points.aRb));
  rows.H.block<3, 3>(0, kAttitudeAt) = cRb;
  rows.H.block<3, 3>(0, at) = -cRb * aRb.transpose();
  if (has_direction) {
    // In the plane across the expected direction: across the measured one, its error would stand in H and in the
    // residual, and their product makes each displacement shorter.
    const Vector3d ahead = moved / length;
    const Matrix3d to_expected = Eigen::Quaterniond::FromTwoVectors(direction, ahead).toRotationMatrix();
    const Eigen::Matrix<double, 2, 3> across = (to_expected * directionBasis(direction)).transpose();
    rows.residual.tail<2>() = across * direction;
    rows.H.bottomRows<2>() = across * by_moved / length;
  }
  const double overlap = std::max(1.0, secondsOf(motion.b_ns - motion.a_ns) / m_dt);
  const Eigen::Index n = rows.residual.size();
  rows.noise = overlap * motion.points.covariance.topLeftCorner(n, n);
  rows.noise.topLeftCorner<3, 3>() += isotropic(kPointsSigma * kPointsSigma);
  all.push_back(rows);
}
} // namespace bole
