// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/camera_motion.h"

#include "geometry/so3.h"

#include <Eigen/Dense>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

void CameraMotion::start(const Pose &cMo, const Matrix6d &covariance)
{
  m_cMo = cMo;
  m_covariance = covariance;
  m_velocity.setZero();
  m_velocity_covariance = m_options.step_sigma_m * m_options.step_sigma_m * Matrix3d::Identity();
  m_cross.setZero();
}

CameraMotion::Expected CameraMotion::predict(int frames, const Matrix3d &c2Rc1, double turn_sigma_rad,
                                             const Vector3d &up)
{
  const double n = frames;
  const Matrix3d across = Matrix3d::Identity() - up * up.transpose();
  m_expected.R = c2Rc1 * m_cMo.R;
  m_expected.t = -(m_expected.R * (m_cMo.inverse().t + n * (across * m_velocity)));

  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = c2Rc1;
  Matrix63d moves = Matrix63d::Zero(); // of the camera by its velocity
  moves.topRows<3>() = m_expected.R;
  m_expected_velocity_covariance =
      across * m_velocity_covariance * across + n * m_options.accel_sigma_m * m_options.accel_sigma_m * across;
  m_expected_cross = turn * m_cross * across;
  const Matrix6d carried = n * m_expected_cross * moves.transpose();
  Matrix6d P = turn * m_covariance * turn.transpose() + carried + carried.transpose();
  P += n * n * moves * m_expected_velocity_covariance * moves.transpose();
  P.topLeftCorner<3, 3>() +=
      n * m_options.climb_sigma_m * m_options.climb_sigma_m * (m_expected.R * up) * (m_expected.R * up).transpose();
  P.diagonal().tail<3>().array() += turn_sigma_rad * turn_sigma_rad;
  m_expected_cross += n * moves * m_expected_velocity_covariance;
  m_expected_covariance = 0.5 * (P + P.transpose());
  return {m_expected, m_expected_covariance};
}

void CameraMotion::update(const Pose &cMo, const Matrix6d &covariance)
{
  Vector6d moved; // cMo = exp(-moved) expected, to first order
  const Pose step = m_expected * cMo.inverse();
  moved << step.t, logSo3(step.R);
  const Eigen::Matrix<double, 3, 6> gain = m_expected_covariance.ldlt().solve(m_expected_cross).transpose();
  m_velocity += gain * moved;
  m_velocity_covariance =
      m_expected_velocity_covariance - gain * (m_expected_covariance - covariance) * gain.transpose();
  m_cross = covariance * gain.transpose();
  m_cMo = cMo;
  m_covariance = covariance;
}

void CameraMotion::replace(const Pose &cMo, const Matrix6d &covariance, int frames)
{
  const Vector3d step = cMo.inverse().t - m_cMo.inverse().t;
  const Matrix3d own = cMo.R.transpose() * covariance.topLeftCorner<3, 3>() * cMo.R;
  m_velocity = step / frames;
  m_velocity_covariance =
      2 * own / (frames * frames) + m_options.accel_sigma_m * m_options.accel_sigma_m * Matrix3d::Identity();
  m_cross.setZero();
  m_cMo = cMo;
  m_covariance = covariance;
}
} // namespace bole
