// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/path_scale.h"

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
// The path's error: white, and walking (kWalkAmongTrees). On simulated flights among trees half the squared difference
// of two errors is 40, 150, 310 mm^2 an axis after 0.1, 1 and 4 s of hovering, 45, 270, 500 in flights of 12 s, once
// the path is laid on the truth, which takes a part of the walk with it.
constexpr double kPathSigma = 0.008;  // horizontal [m]
constexpr double kPathHeight = 0.02;  // of the path [m]
constexpr double kPathHeading = 0.02; // of the path [rad]
constexpr double kCompared_s = 0.09;  // errors of the path nearer in time than that are alike
constexpr double kRemembered_s = 60;  // of the path compared
} // namespace

void PathScale::add(const Frame &frame)
{
  m_steps.push_back(stepTo(frame));
  m_stamp_ns = frame.stamp_ns;
  ++m_frames;
  double kept_s = 0;
  for (const Step &step : m_steps)
    kept_s += step.duration;
  if (kept_s - m_steps.front().duration > kRemembered_s)
    m_steps.pop_front();
}

void PathScale::forget(double last_s)
{
  for (auto step = m_steps.rbegin(); step != m_steps.rend() && last_s > 0; ++step) {
    step->is_known = false;
    step->is_bias_open = true;
    last_s -= step->duration;
  }
}

/// The samples' means held in between.
PathScale::Step PathScale::stepTo(const Frame &frame)
{
  Step step;
  step.frame = m_frames;
  if (frame.wMb_odometry)
    step.up = frame.wMb_odometry->R.transpose() * Vector3d::UnitZ();
  std::int64_t at_ns = m_stamp_ns;
  step.is_known = m_frames > 0;
  int samples = 0;
  const auto advance = [&](const GyroSample &first, const GyroSample &second, std::int64_t end_ns) {
    const double dt = 1e-9 * static_cast<double>(end_ns - at_ns);
    step.is_known = step.is_known && std::max(dt, 1e-9 * static_cast<double>(end_ns - first.stamp_ns)) <= kMostGap_s;
    const Vector3d force = step.turn * (0.5 * (*first.force + *second.force));
    step.moved += dt * step.velocity + 0.5 * dt * dt * force;
    step.velocity += dt * force;
    step.turn = step.turn * expSo3(0.5 * (first.rate + second.rate) * dt);
    at_ns = end_ns;
    ++samples;
  };
  for (const GyroSample &sample : frame.gyro) {
    if (!sample.force) {
      m_last.reset();
      step.is_known = false;
      continue;
    }
    if (!m_first_force)
      m_first_force = sample.force;
    m_force_varies = m_force_varies || *m_first_force != *sample.force;
    const std::int64_t end_ns = std::min(sample.stamp_ns, frame.stamp_ns);
    if (end_ns > at_ns)
      advance(m_last.value_or(sample), sample, end_ns);
    m_last = sample;
  }
  if (m_last && frame.stamp_ns > at_ns)
    advance(*m_last, *m_last, frame.stamp_ns);
  step.is_known = step.is_known && m_last;
  step.duration = m_frames > 0 ? 1e-9 * static_cast<double>(frame.stamp_ns - m_stamp_ns) : 0;
  if (samples > 0)
    step.longer = std::max(1.0, accelerometer::kRate * step.duration / samples);
  return step;
}

/// One pass over the path at one scale.
class PathScale::Filter
{
  // Where the errors stand in the state: attitude (right tangent), velocity and place on the path, biases.
  static constexpr int kAttitude = 0, kVelocity = 3, kPlace = 6, kGyro = 9, kForce = 12, kStates = 15;
  using States = Eigen::Matrix<double, kStates, kStates>;
  using Row = Eigen::Matrix<double, 1, kStates>;

public:
  Filter(const GyroOptions &gyro, double walk, double log_scale)
      : m_gyro(gyro), m_walk(walk), m_factor(std::exp(log_scale), std::exp(log_scale), 1)
  {
    m_covariance.diagonal().segment<3>(kGyro).setConstant(std::pow(gyro.bias_sigma, 2));
    m_covariance.diagonal().segment<3>(kForce).setConstant(std::pow(accelerometer::kBiasSigma, 2));
  }

  double logLikelihood() const { return m_log_likelihood; }
  int compared() const { return m_compared; }

  /// Resets the states of motion and keeps the constants. The velocity is that of the path from \p before, loosely.
  void start(const Pose &before, const Pose &now, const Step &step)
  {
    constexpr double kTilt = 0.02; // of the path [rad]
    m_covariance.topRows<kGyro>().setZero();
    m_covariance.leftCols<kGyro>().setZero();
    m_wRb = now.R;
    m_velocity = (now.t - before.t) / step.duration;
    m_place = now.t;
    const double speed_sigma = 0.3 + 0.3 * m_velocity.norm();
    m_covariance.diagonal().segment<3>(kAttitude).setConstant(kTilt * kTilt);
    m_covariance.diagonal().segment<3>(kVelocity).setConstant(speed_sigma * speed_sigma);
    m_covariance.diagonal().segment<3>(kPlace) = placeVariance();
    if (!step.is_bias_open)
      return;
    m_covariance.middleRows<3>(kForce).setZero();
    m_covariance.middleCols<3>(kForce).setZero();
    m_covariance.diagonal().segment<3>(kForce).setConstant(std::pow(accelerometer::kFaultSigma, 2));
  }

  void predict(const Step &step)
  {
    const Vector3d gravity(0, 0, -kGravity); // [m/s^2]
    const double dt = step.duration;
    const Matrix3d turn = step.turn * expSo3(-m_gyro_bias * dt), stretch = m_factor.asDiagonal() * m_wRb;
    // a bias of the gyro turns what was measured later in the step the more
    const Matrix3d velocity_by_gyro = 0.5 * dt * skew(step.velocity);
    const Vector3d gained = step.velocity + velocity_by_gyro * m_gyro_bias - dt * m_force_bias;
    const Vector3d moved = step.moved - 0.5 * dt * dt * m_force_bias;

    States F = States::Identity();
    F.block<3, 3>(kAttitude, kAttitude) = turn.transpose();
    F.block<3, 3>(kAttitude, kGyro) = -dt * Matrix3d::Identity();
    F.block<3, 3>(kVelocity, kAttitude) = -stretch * skew(gained);
    F.block<3, 3>(kVelocity, kGyro) = stretch * velocity_by_gyro;
    F.block<3, 3>(kVelocity, kForce) = -dt * stretch;
    F.block<3, 3>(kPlace, kAttitude) = -stretch * skew(moved);
    F.block<3, 3>(kPlace, kVelocity) = dt * Matrix3d::Identity();
    F.block<3, 3>(kPlace, kForce) = -0.5 * dt * dt * stretch;
    m_covariance = (F * m_covariance * F.transpose()).eval();
    const auto white = [&](int at, const Vector3d &density) {
      m_covariance.diagonal().segment<3>(at) += dt * density.cwiseAbs2();
    };
    const Vector3d force = accelerometer::kNoise * std::sqrt(step.longer) * m_factor;
    white(kAttitude, Vector3d::Constant(m_gyro.noise_density * std::sqrt(step.longer)));
    white(kVelocity, force);
    white(kPlace, dt / std::sqrt(3.0) * force);
    white(kPlace, Vector3d(m_walk, m_walk, 0));
    white(kGyro, Vector3d::Constant(kBiasWalk));
    white(kForce, Vector3d::Constant(accelerometer::kBiasWalk));

    m_place += dt * m_velocity + m_factor.cwiseProduct(0.5 * dt * dt * gravity + m_wRb * moved);
    m_velocity += m_factor.cwiseProduct(dt * gravity + m_wRb * gained);
    m_wRb = orthonormalized(m_wRb * turn);
  }

  /// Kalman update by the pose filter's roll and pitch: where up is.
  void compareTilt(const Vector3d &measured)
  {
    const Vector3d up = m_wRb.transpose() * Vector3d::UnitZ(), left = up.unitOrthogonal();
    for (const Vector3d &across : {left, Vector3d(up.cross(left))}) {
      Row H = Row::Zero();
      H.segment<3>(kAttitude) = across.transpose() * skew(up);
      update(H, across.dot(measured - up), std::pow(accelerometer::kTiltSigma, 2));
    }
  }

  /// Kalman update by the place on the path and its heading.
  void comparePath(const Pose &wMb)
  {
    for (int axis = 0; axis < 3; ++axis) {
      Row H = Row::Zero();
      H(kPlace + axis) = 1;
      update(H, wMb.t(axis) - m_place(axis), placeVariance()(axis));
    }
    const Vector3d up = m_wRb.transpose() * Vector3d::UnitZ();
    Row H = Row::Zero();
    H.segment<3>(kAttitude) = up.transpose();
    update(H, up.dot(logSo3(m_wRb.transpose() * wMb.R)), std::pow(kPathHeading, 2));
    ++m_compared;
  }

private:
  Vector3d placeVariance() const
  {
    const double across2 = std::pow(kPathSigma, 2);
    return {across2, across2, std::pow(kPathHeight, 2)};
  }

  /// Kalman's update by one number.
  void update(const Row &H, double residual, double variance)
  {
    const Eigen::Matrix<double, kStates, 1> PHt = m_covariance * H.transpose();
    const double innovation = (H * PHt).value() + variance;
    const Eigen::Matrix<double, kStates, 1> change = PHt * (residual / innovation);
    m_covariance -= PHt * PHt.transpose() / innovation;
    m_log_likelihood -= 0.5 * residual * residual / innovation;
    m_wRb = m_wRb * expSo3(change.segment<3>(kAttitude));
    m_velocity += change.segment<3>(kVelocity);
    m_place += change.segment<3>(kPlace);
    m_gyro_bias += change.segment<3>(kGyro);
    m_force_bias += change.segment<3>(kForce);
  }

  const GyroOptions &m_gyro;
  double m_walk;     ///< of the path
  Vector3d m_factor; ///< of the path's lengths
  Matrix3d m_wRb = Matrix3d::Identity();
  Vector3d m_velocity = Vector3d::Zero(), m_place = Vector3d::Zero(); ///< on the path
  Vector3d m_gyro_bias = Vector3d::Zero(), m_force_bias = Vector3d::Zero();
  double m_log_likelihood = 0;
  int m_compared = 0;
  States m_covariance = States::Zero();
};

/// Log-likelihood of the path at one scale; nothing where it was compared nowhere.
std::optional<double> PathScale::logLikelihood(const std::vector<Pose> &path, double log_scale) const
{
  Filter filter(m_gyro, m_walk, log_scale);
  bool is_started = false;
  double since_s = 0; // it was compared
  for (std::size_t i = 1; i < m_steps.size(); ++i) {
    const Step &step = m_steps[i];
    since_s += step.duration;
    if (is_started && step.is_known) {
      filter.predict(step);
      if (since_s < kCompared_s)
        continue;
      if (step.up)
        filter.compareTilt(*step.up);
      filter.comparePath(path[i]);
    }
    else if (step.duration > 0) {
      filter.start(path[i - 1], path[i], step);
      is_started = true;
    }
    since_s = 0;
  }
  return filter.compared() > 0 ? std::optional<double>(filter.logLikelihood()) : std::nullopt;
}

/// The scale at which likelihood and prior together are greatest, by Newton's steps on a parabola through three scales.
std::optional<PathScale::Peak> PathScale::findPeak(const std::vector<Pose> &path, double from, double prior) const
{
  constexpr double kApart = 0.03, kMostStep = 0.2, kSettled = 0.003; // of the log of the scale
  constexpr double kLeast = 4; // information: a slope that does not bend tells a side, not a place
  constexpr int kMostRounds = 6;
  Peak peak{from, 0, 0, 0};
  for (int round = 0; round < kMostRounds; ++round) {
    const auto less = logLikelihood(path, peak.log_scale - kApart), here = logLikelihood(path, peak.log_scale),
               more = logLikelihood(path, peak.log_scale + kApart);
    if (!less || !here || !more)
      return std::nullopt;
    peak.log_likelihood = *here;
    peak.information = std::max(kLeast, (2 * *here - *less - *more) / (kApart * kApart));
    peak.alone = peak.log_scale + (*more - *less) / (2 * kApart) / peak.information;
    const double step = peak.information * peak.alone / (peak.information + prior) - peak.log_scale;
    peak.log_scale += std::clamp(step, -kMostStep, kMostStep);
    if (std::abs(step) < kSettled)
      return peak;
  }
  return std::nullopt;
}

std::optional<LogScale> PathScale::measure(const Path &path, double prior_sigma)
{
  constexpr double kContradiction = 9; // of twice the log of likelihood and prior
  if (!m_force_varies)
    return std::nullopt;
  std::vector<Pose> poses;
  for (const Step &step : m_steps)
    poses.push_back(path(step.frame));
  const double prior = 1 / std::max(1e-12, prior_sigma * prior_sigma);
  auto peak = findPeak(poses, m_log_scale, prior);
  if (!peak && m_log_scale != 0)
    peak = findPeak(poses, 0, prior);
  m_log_scale = 0;
  if (!peak)
    return std::nullopt;
  m_log_scale = peak->log_scale;
  LogScale scale{peak->log_scale, 1 / std::sqrt(peak->information + prior), false};
  if (peak->alone * peak->alone <= kContradiction * (1 / peak->information + 1 / prior))
    return scale;
  // Far from its peak a likelihood is no parabola: without the prior, is it really so much greater?
  const auto free = findPeak(poses, peak->log_scale, 0);
  if (free && 2 * (free->log_likelihood - peak->log_likelihood) + prior * std::pow(peak->log_scale, 2) > kContradiction)
    scale = {free->log_scale, 1 / std::sqrt(free->information), true};
  m_log_scale = scale.mean;
  return scale;
}
} // namespace bole
