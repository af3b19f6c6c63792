// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/inertial_scale.h"

#include "geometry/constants.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace
{
// Where the errors stand in the state: attitude (right tangent), velocity, displacement, biases, log of the scale.
constexpr int kAttitude = 0, kVelocity = 3, kMoved = 6, kGyro = 9, kForce = 12, kScale = 15;
const Vector3d kGravityVector(0, 0, -kGravity); // [m/s^2]
constexpr double kWindow_s = 0.25;              // least time between two comparisons
constexpr double kShare = 0.07;                 // of one comparison in their mean: a second
constexpr double kMostMisfit = 2;               // such a mean; at most 1.7 on eleven flights without a fault
constexpr double kGate = 30;                    // squared innovation over its variance: not of this model

/// Two rows that span what is across \p unit.
Eigen::Matrix<double, 2, 3> across(const Vector3d &unit)
{
  Eigen::Matrix<double, 2, 3> rows;
  rows.row(0) = unit.unitOrthogonal().transpose();
  rows.row(1) = unit.cross(Vector3d(rows.row(0))).transpose();
  return rows;
}
} // namespace

InertialScale::InertialScale(const Pose &bMc, const GyroOptions &gyro, double start_sigma)
    : m_bMc(bMc), m_gyro(gyro), m_start_sigma(start_sigma)
{
  m_covariance.diagonal().segment<3>(kGyro).setConstant(std::pow(gyro.bias_sigma, 2));
  m_covariance.diagonal().segment<3>(kForce).setConstant(std::pow(accelerometer::kBiasSigma, 2));
  m_covariance(kScale, kScale) = std::pow(start_sigma, 2);
}

void InertialScale::process(const Frame &frame, const std::vector<RelativeMotion> &motions)
{
  m_has_begun_anew = false;
  if (!collect(frame) || !m_anchor || (!m_started && !frame.wMb_odometry)) {
    restart(frame);
    return;
  }
  const double duration = secondsOf(frame.stamp_ns - m_anchor->stamp_ns);
  const auto seen = std::find_if(motions.begin(), motions.end(), [this](const RelativeMotion &motion) {
    return motion.a_index == m_anchor->index && motion.points.hasRotation();
  });
  if (duration < kWindow_s || (seen == motions.end() && duration < 2 * kWindow_s))
    return;
  if (!m_started)
    start(frame);
  if (!predict(frame.stamp_ns)) {
    restart(frame);
    return;
  }
  if (frame.wMb_odometry)
    compareTilt(*frame.wMb_odometry);
  if (frame.wMb_odometry && m_anchor->wMb) {
    compareOdometry(*frame.wMb_odometry, duration);
    ++m_compared;
  }
  if (seen != motions.end())
    comparePoints(seen->points, duration);
  if (m_misfit > kMostMisfit)
    beginAnew();
  if (frame.wMb_odometry || m_started)
    begin(frame);
}

/// Another bias than before, or worse: what was learnt rests on something else.
void InertialScale::beginAnew()
{
  const bool varies = m_force_varies;
  *this = InertialScale(m_bMc, m_gyro, m_start_sigma);
  m_covariance.diagonal().segment<3>(kForce).setConstant(std::pow(accelerometer::kFaultSigma, 2));
  m_force_varies = varies;
  m_has_begun_anew = true;
}

/// Keeps the samples of the frame; false where they have no force.
bool InertialScale::collect(const Frame &frame)
{
  for (const GyroSample &sample : frame.gyro) {
    if (!sample.force)
      return false;
    if (!m_first_force)
      m_first_force = sample.force;
    m_force_varies = m_force_varies || *m_first_force != *sample.force;
    m_samples.push_back(sample);
  }
  return !m_samples.empty();
}

/// Resets the states of motion and keeps the constants.
void InertialScale::restart(const Frame &frame)
{
  m_started = false;
  m_anchor.reset();
  if (m_samples.size() > 1)
    m_samples.erase(m_samples.begin(), m_samples.end() - 1);
  m_covariance.topRows<kGyro>().setZero();
  m_covariance.leftCols<kGyro>().setZero();
  if (frame.wMb_odometry)
    begin(frame);
}

void InertialScale::begin(const Frame &frame)
{
  m_anchor = Anchor{frame.stamp_ns, frame.index, frame.wMb_odometry};
  if (m_samples.size() > 1)
    m_samples.erase(m_samples.begin(), m_samples.end() - 1);
  m_moved.setZero();
  m_turned.setIdentity();
  m_covariance.middleRows<3>(kMoved).setZero();
  m_covariance.middleCols<3>(kMoved).setZero();
}

/// Attitude and velocity at the anchor from the odometry: the velocity loosely, since its scale is what is asked for.
void InertialScale::start(const Frame &frame)
{
  const double duration = secondsOf(frame.stamp_ns - m_anchor->stamp_ns);
  m_wRb = m_anchor->wMb->R;
  m_velocity = (frame.wMb_odometry->t - m_anchor->wMb->t) / duration;
  const double tilt2 = std::pow(accelerometer::kTiltSigma, 2), velocity_sigma = 0.3 + 0.3 * m_velocity.norm();
  m_covariance.diagonal().segment<3>(kAttitude) << tilt2, tilt2, 1e-6;
  m_covariance.diagonal().segment<3>(kVelocity).setConstant(velocity_sigma * velocity_sigma);
  m_started = true;
}

/// From the anchor to \p to_ns through the samples, their means held in between; false where samples are missing.
bool InertialScale::predict(std::int64_t to_ns)
{
  std::int64_t at_ns = m_anchor->stamp_ns;
  const GyroSample *before = nullptr;
  for (const GyroSample &sample : m_samples) {
    const std::int64_t end_ns = std::min(sample.stamp_ns, to_ns);
    if (end_ns > at_ns) {
      if (secondsOf(end_ns - at_ns) > kMostGap_s)
        return false;
      const GyroSample &first = before != nullptr ? *before : sample;
      propagate(0.5 * (first.rate + sample.rate), 0.5 * (*first.force + *sample.force), secondsOf(end_ns - at_ns));
      at_ns = end_ns;
    }
    before = &sample;
  }
  if (before == nullptr || secondsOf(to_ns - at_ns) > kMostGap_s)
    return false;
  if (to_ns > at_ns)
    propagate(before->rate, *before->force, secondsOf(to_ns - at_ns));
  m_wRb = orthonormalized(m_wRb);
  return true;
}

void InertialScale::propagate(const Vector3d &rate, const Vector3d &force, double dt)
{
  const Matrix3d turn = expSo3((rate - m_gyro_bias) * dt);
  const Vector3d specific = force - m_force_bias;
  const Matrix3d by_attitude = -m_wRb * skew(specific) * dt;
  const auto advance = [&] { // the rows of the covariance
    using Rows = Eigen::Matrix<double, 3, kStates>;
    const Rows attitude = m_covariance.middleRows<3>(kAttitude), velocity = m_covariance.middleRows<3>(kVelocity);
    const Rows pushed = by_attitude * attitude - dt * m_wRb * m_covariance.middleRows<3>(kForce);
    m_covariance.middleRows<3>(kAttitude) = turn.transpose() * attitude - dt * m_covariance.middleRows<3>(kGyro);
    m_covariance.middleRows<3>(kVelocity) += pushed;
    m_covariance.middleRows<3>(kMoved) += dt * velocity + 0.5 * dt * pushed;
  };
  advance();
  m_covariance.transposeInPlace(); // F P F^T = F (F P)^T
  advance();
  const auto white = [&](int at, double density, double longer) {
    m_covariance.diagonal().segment<3>(at).array() += density * density * dt * longer;
  };
  const double longer = std::max(1.0, accelerometer::kRate * dt);
  white(kAttitude, m_gyro.noise_density, longer);
  white(kVelocity, accelerometer::kNoise, longer);
  white(kGyro, kBiasWalk, 1);
  white(kForce, accelerometer::kBiasWalk, 1);

  const Vector3d acceleration = m_wRb * specific + kGravityVector;
  m_moved += dt * m_velocity + 0.5 * dt * dt * acceleration;
  m_velocity += dt * acceleration;
  m_wRb = m_wRb * turn;
  m_turned = m_turned * turn;
}

/// Kalman's update; a residual far beyond its covariance is left out.
void InertialScale::update(const Eigen::MatrixXd &H, const Eigen::VectorXd &residual, const Eigen::MatrixXd &noise)
{
  const Eigen::MatrixXd PHt = m_covariance * H.transpose(), S = H * PHt + noise;
  const Eigen::LDLT<Eigen::MatrixXd> solver(S);
  const Eigen::VectorXd solved = solver.solve(residual);
  const double squares = residual.dot(solved);
  m_misfit += kShare * (std::min(squares, kGate) / static_cast<double>(residual.size()) - m_misfit);
  if (!(squares < kGate))
    return;
  const Eigen::VectorXd change = PHt * solved;
  const Eigen::MatrixXd gain = solver.solve(PHt.transpose()).transpose();
  const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(kStates, kStates) - gain * H;
  m_covariance = (left * m_covariance * left.transpose() + gain * noise * gain.transpose()).eval();
  m_wRb = m_wRb * expSo3(change.segment<3>(kAttitude));
  m_velocity += change.segment<3>(kVelocity);
  m_moved += change.segment<3>(kMoved);
  m_gyro_bias += change.segment<3>(kGyro);
  m_force_bias += change.segment<3>(kForce);
  m_log_scale += change(kScale);
}

/// Kalman update by the odometry's roll and pitch: where up is.
void InertialScale::compareTilt(const Pose &wMb)
{
  const Vector3d up = m_wRb.transpose() * Vector3d::UnitZ(), measured = wMb.R.transpose() * Vector3d::UnitZ();
  const Eigen::Matrix<double, 2, 3> rows = across(up);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2, kStates);
  H.middleCols<3>(kAttitude) = rows * skew(up);
  update(H, rows * (measured - up), std::pow(accelerometer::kTiltSigma, 2) * Eigen::Matrix2d::Identity());
}

/// Kalman update by the displacement of the odometry in the heading of this filter: its horizontal part has the scale.
void InertialScale::compareOdometry(const Pose &wMb, double duration)
{
  const Vector3d in_body = wMb.R.transpose() * (wMb.t - m_anchor->wMb->t);
  const double scale = std::exp(m_log_scale);
  const Vector3d factor(scale, scale, 1);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3, kStates);
  H.middleCols<3>(kMoved) = factor.asDiagonal();
  H.middleCols<3>(kAttitude) = m_wRb * skew(in_body);
  H.block<2, 1>(0, kScale) = scale * m_moved.head<2>();
  const double walk2 = std::pow(odometry::kWalk, 2) * duration;
  const Vector3d noise(walk2, walk2, std::pow(odometry::kHeightSigma, 2));
  update(H, m_wRb * in_body - factor.cwiseProduct(m_moved), Matrix3d(noise.asDiagonal()));
}

/// The motion of the camera since the anchor, by the points: its rotation, which shows the bias of the gyro, and the
/// direction of its displacement. The points hardly tell one from the other, so that their errors go together: where
/// the gyro knows the rotation, the direction is known much better than by itself.
void InertialScale::comparePoints(const RelativePoseEstimate &points, double duration)
{
  constexpr double kLeast = 0.02; // [m]: shorter displacements have no direction
  const Matrix3d wRa = m_wRb * m_turned.transpose(), wRc = wRa * m_bMc.R;
  const Vector3d moved = m_moved + (m_wRb - wRa) * m_bMc.t;
  const Vector3d expected = moved.normalized(), direction = wRc * points.direction;
  const bool has_direction = points.hasDirection() && moved.norm() >= kLeast && direction.dot(expected) > 0;
  m_directions += has_direction;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(5, kStates);
  Eigen::VectorXd residual(5);
  H.block<3, 3>(0, kGyro) = -duration * Matrix3d::Identity();
  residual.head<3>() = logSo3(m_turned.transpose() * m_bMc.R * points.aRb * m_bMc.R.transpose());
  if (has_direction) {
    // In the plane across the expected direction: across the measured one, its error would stand in H and in the
    // residual, and their product makes each displacement shorter.
    const Matrix3d to_expected = Eigen::Quaterniond::FromTwoVectors(direction, expected).toRotationMatrix();
    const Eigen::Matrix<double, 2, 3> across = (to_expected * wRc * directionBasis(points.direction)).transpose();
    const Eigen::Matrix<double, 2, 3> by_attitude = across * m_wRb * skew(m_wRb.transpose() * expected);
    H.block<2, 3>(3, kMoved) = across / moved.norm();
    H.block<2, 3>(3, kAttitude) = by_attitude;
    H.block<2, 3>(3, kGyro) = duration * by_attitude;
    residual.tail<2>() = across * direction;
  }
  Matrix5d to_body = Matrix5d::Identity();
  to_body.topLeftCorner<3, 3>() = m_bMc.R;
  Eigen::MatrixXd noise = to_body * points.covariance * to_body.transpose();
  noise.topLeftCorner(3, 3) += std::pow(m_gyro.noise_density, 2) * duration * Matrix3d::Identity();
  const Eigen::Index rows = has_direction ? 5 : 3;
  update(H.topRows(rows), residual.head(rows), noise.topLeftCorner(rows, rows));
}

std::optional<InertialStep> InertialScale::stepTo(const Frame &frame, std::int64_t from_ns) const
{
  if (!m_started || !m_force_varies || !m_anchor || from_ns < m_anchor->stamp_ns)
    return std::nullopt;
  const auto at = [&](std::int64_t to_ns) {
    std::optional<InertialScale> ahead = *this;
    if (!ahead->collect(frame) || !ahead->predict(to_ns))
      ahead.reset();
    return ahead;
  };
  const auto from = at(from_ns), to = at(frame.stamp_ns);
  if (!from || !to)
    return std::nullopt;
  const double since = secondsOf(frame.stamp_ns - m_anchor->stamp_ns), dt = secondsOf(frame.stamp_ns - from_ns);
  const double tilt2 = m_covariance.diagonal().segment<2>(kAttitude).mean();
  const double speed2 =
      m_covariance.diagonal().segment<3>(kVelocity).mean() + kGravity * kGravity * tilt2 * since * since;
  constexpr double kLasts_s = 2;       // an error of the velocity does not average out for so long
  constexpr double kLeastStep = 0.003; // [m]
  const double scale = std::exp(m_log_scale);
  InertialStep step;
  step.moved = from->m_wRb.transpose() * Vector3d(scale, scale, 1).cwiseProduct(to->m_moved - from->m_moved);
  step.sigma = std::hypot(kLeastStep, std::sqrt(speed2 * dt * kLasts_s));
  return step;
}

std::optional<LogScale> InertialScale::scale(double prior_sigma) const
{
  if (m_compared == 0 || 4 * m_directions < m_compared || !m_force_varies)
    return std::nullopt;
  const double variance = m_covariance(kScale, kScale), prior2 = prior_sigma * prior_sigma;
  if (m_log_scale * m_log_scale > 9 * (variance + prior2)) // it contradicts the prior
    return LogScale{m_log_scale, std::sqrt(variance)};
  const double measured = std::max(0.0, 1 / variance - std::pow(m_start_sigma, -2)); // without its own prior
  const double information = measured + 1 / std::max(1e-12, prior2);
  return LogScale{m_log_scale / variance / information, 1 / std::sqrt(information)};
}
} // namespace bole
