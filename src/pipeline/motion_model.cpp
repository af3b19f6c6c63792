// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/motion_model.h"

#include "geometry/so3.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace
{
constexpr double kStep_s = 0.1;    // of the walks that the options state
constexpr double kGyroTurn = 8e-4; // least walk of the gyro's rotation in a step [rad]
constexpr double kFreeStep = 0.15; // of a step that nothing measured: of a constant velocity [m]
constexpr double kFreeTurn = 0.02; // of a turn that nothing measured [rad]
constexpr double kLeast_s = 1e-3;  // between two frames; those of one stamp are no step without noise

/// Height, roll and pitch of \p wMb, with the yaw of \p wRb_yaw: x, y and yaw stay free.
PosePrior levelPrior(const Pose &wMb, const Matrix3d &wRb_yaw, double height_sigma, double tilt_sigma)
{
  const auto yaw = [](const Matrix3d &R) { return std::atan2(R(1, 0), R(0, 0)); };
  PosePrior prior;
  prior.mean = wMb;
  prior.mean.R = Eigen::AngleAxisd(yaw(wRb_yaw) - yaw(wMb.R), Vector3d::UnitZ()).toRotationMatrix() * wMb.R;
  const Matrix3d bRw = prior.mean.R.transpose();
  prior.covariance.setZero();
  prior.covariance.topLeftCorner<3, 3>() =
      bRw * Vector3d(1e4, 1e4, height_sigma * height_sigma).asDiagonal() * bRw.transpose();
  prior.covariance.bottomRightCorner<3, 3>() =
      bRw * Vector3d(tilt_sigma * tilt_sigma, tilt_sigma * tilt_sigma, 10).asDiagonal() * bRw.transpose();
  return prior;
}
} // namespace

MotionModel::MotionModel(const MotionModelOptions &options, const GyroOptions &gyro) : m_options(options), m_gyro(gyro)
{
}

PosePrior MotionModel::first(const Frame &frame) const
{
  PosePrior prior;
  const double tilt2 = std::pow(frame.wMb_odometry ? m_options.tilt_sigma : 0.05, 2);
  const double height2 = std::pow(frame.wMb_odometry ? m_options.height_sigma : 1e-3, 2);
  if (frame.wMb_odometry)
    prior.mean = *frame.wMb_odometry;
  prior.covariance.setZero();
  prior.covariance.diagonal() << 1e-6, 1e-6, height2, tilt2, tilt2, 1e-6;
  return prior;
}

MotionStep MotionModel::step(const Frame &frame, const Pose &wMa, const GyroBias &bias, const Vector6d &velocity,
                             const std::optional<InertialStep> &inertial)
{
  MotionStep step;
  const double dt = 1e-9 * static_cast<double>(frame.stamp_ns - m_stamp_ns);
  const double longer = std::max(dt, kLeast_s) / kStep_s,
               walked = std::sqrt(longer); // than what the options are stated for
  const GyroRotation gyro = integrateGyro(frame.gyro, m_stamp_ns, frame.stamp_ns, bias, m_gyro);
  const bool odometry = m_odometry && frame.wMb_odometry;
  const Pose filter = odometry ? m_odometry->inverse() * *frame.wMb_odometry : Pose();

  Matrix3d turn_covariance;
  if (gyro.complete && !frame.gyro.empty()) {
    step.turn_from_gyro = true;
    step.aMb.R = gyro.R;
    turn_covariance = gyro.covariance() + std::pow(walked * kGyroTurn, 2) * Matrix3d::Identity();
  }
  else if (odometry) {
    step.aMb.R = filter.R;
    turn_covariance = std::pow(m_options.turn_sigma, 2) * Matrix3d::Identity();
  }
  else {
    step.aMb.R = expSo3(velocity.tail<3>() * dt);
    turn_covariance = std::pow(longer * kFreeTurn, 2) * Matrix3d::Identity();
  }

  Vector3d sigma;
  if (odometry) {
    step.is_step_measured = true;
    step.aMb.t = filter.t;
    const double along = m_options.step_scale_sigma * filter.t.norm() / walked;
    const double across = std::hypot(walked * m_options.step_sigma, along);
    sigma << across, across, std::hypot(m_options.step_sigma_vertical, along);
    step.absolute = levelPrior(*frame.wMb_odometry, wMa.R * step.aMb.R, m_options.height_sigma, m_options.tilt_sigma);
  }
  else if (inertial && inertial->sigma < longer * kFreeStep) {
    step.is_step_measured = true;
    step.aMb.t = inertial->moved;
    sigma.setConstant(inertial->sigma);
  }
  else {
    step.aMb.t = velocity.head<3>() * dt;
    sigma.setConstant(longer * kFreeStep);
  }
  step.covariance.setZero();
  // the tangent rho stands in b: turned by aRb from the steps measured in a, equal to first order for small turns
  step.covariance.topLeftCorner<3, 3>() = sigma.cwiseAbs2().asDiagonal();
  step.covariance.bottomRightCorner<3, 3>() = turn_covariance;
  return step;
}

void MotionModel::advance(const Frame &frame)
{
  m_stamp_ns = frame.stamp_ns;
  m_odometry = frame.wMb_odometry;
}
} // namespace bole
