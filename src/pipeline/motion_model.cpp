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
constexpr double kStep_s = 0.1;   // of the walks that the options state
constexpr double kLeast_s = 1e-3; // between two frames; those of one stamp are no step without noise
} // namespace

MotionModel::MotionModel(const MotionModelOptions &options, const GyroOptions &gyro) : m_options(options), m_gyro(gyro)
{
}

PosePrior MotionModel::first(const Frame &frame) const
{
  PosePrior prior;
  if (frame.wMb_odometry && m_options.relative_alone)
    return {*frame.wMb_odometry, 1e-6 * Matrix6d::Identity()}; // p(x1) only anchors
  const double tilt2 = std::pow(frame.wMb_odometry ? m_options.tilt_sigma : 0.05, 2);
  const double height2 = std::pow(frame.wMb_odometry ? m_options.height_sigma : 1e-3, 2);
  if (frame.wMb_odometry)
    prior.mean = *frame.wMb_odometry;
  prior.covariance.setZero();
  prior.covariance.diagonal() << 1e-6, 1e-6, height2, tilt2, tilt2, 1e-6;
  return prior;
}

/// Height, roll and pitch with the yaw of \p wRb_yaw: x, y and yaw stay free. The height wanders, as that of a
/// barometer and over bumps of the ground: what the frames of a second say of it counts once.
PosePrior MotionModel::levelPrior(const FilterSays &filter, const Matrix3d &wRb_yaw, double dt) const
{
  constexpr double kWanders = 0.1, kTogether_s = 1; // [m]
  constexpr double kFree = 1e8, kUnknown = 1e4;     // variances [m^2], [rad^2]
  const auto yaw = [](const Matrix3d &R) { return std::atan2(R(1, 0), R(0, 0)); };
  PosePrior prior;
  prior.mean = *filter.wMb;
  prior.mean.R =
      Eigen::AngleAxisd(yaw(wRb_yaw) - yaw(prior.mean.R), Vector3d::UnitZ()).toRotationMatrix() * prior.mean.R;
  const double shared = std::max(1.0, kTogether_s / std::max(dt, kLeast_s));
  const double height2 =
      filter.has_height ? shared * kWanders * kWanders + std::pow(m_options.height_sigma, 2) : kUnknown;
  const double tilt2 = filter.has_tilt ? std::pow(m_options.tilt_sigma, 2) : kUnknown;
  const Matrix3d bRw = prior.mean.R.transpose();
  prior.covariance.setZero();
  prior.covariance.topLeftCorner<3, 3>() = bRw * Vector3d(kFree, kFree, height2).asDiagonal() * bRw.transpose();
  prior.covariance.bottomRightCorner<3, 3>() = bRw * Vector3d(tilt2, tilt2, kUnknown).asDiagonal() * bRw.transpose();
  return prior;
}

Matrix6d MotionModel::odometryCovariance(const Pose &aMb, double seconds, bool has_turn) const
{
  constexpr double kUnknown = 10; // [rad]
  const double walked = std::sqrt(std::max(seconds, kLeast_s) / kStep_s);
  const double along = m_options.step_scale_sigma * aMb.t.norm() / walked;
  const double across = std::hypot(walked * m_options.step_sigma, along);
  Matrix6d covariance = Matrix6d::Zero();
  // the tangent rho stands in b: turned by aRb from the steps measured in a, equal to first order for small turns
  covariance.diagonal() << across * across, across * across,
      std::pow(std::hypot(m_options.step_sigma_vertical, along), 2),
      Vector3d::Constant(std::pow(has_turn ? m_options.turn_sigma : kUnknown, 2));
  return covariance;
}

MotionStep MotionModel::step(const Frame &frame, const Pose &wMa, const GyroBias &bias, const Vector6d &velocity,
                             const FilterSays &filter)
{
  MotionStep step;
  const double dt = 1e-9 * static_cast<double>(frame.stamp_ns - m_stamp_ns);
  const double longer = std::max(dt, kLeast_s) / kStep_s,
               walked = std::sqrt(longer); // than what the options are stated for
  const GyroRotation gyro = integrateGyro(frame.gyro, m_stamp_ns, frame.stamp_ns, bias, m_gyro);
  if (filter.aMb) {
    step.is_step_measured = true;
    step.aMb = *filter.aMb;
    step.covariance = odometryCovariance(*filter.aMb, dt, filter.has_turn);
  }
  else {
    step.aMb = Pose(expSo3(velocity.tail<3>() * dt), velocity.head<3>() * dt);
    double sigma = longer * m_options.free_step_sigma;
    if (filter.free_step && filter.free_step->sigma < sigma) {
      step.is_step_measured = true;
      step.aMb.t = filter.free_step->moved;
      sigma = filter.free_step->sigma;
    }
    step.covariance.setZero();
    step.covariance.diagonal() << Vector3d::Constant(sigma * sigma),
        Vector3d::Constant(std::pow(longer * m_options.free_turn_sigma, 2));
  }
  if (gyro.complete && !frame.gyro.empty() && !(filter.aMb && m_options.relative_alone)) {
    step.turn_from_gyro = true;
    step.aMb.R = gyro.R;
    step.covariance.bottomRightCorner<3, 3>() =
        gyro.covariance() + std::pow(walked * m_options.gyro_turn_sigma, 2) * Matrix3d::Identity();
  }
  if (filter.wMb && !m_options.relative_alone)
    step.absolute = levelPrior(filter, wMa.R * step.aMb.R, dt);
  return step;
}
} // namespace bole
