// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where a camera without odometry is expected in the next frame, and how well that is known.
///
/// Idea: a Kalman filter on pose and velocity. The turn since the last good frame is measured elsewhere (alignment of
/// whole images); the position goes on by the velocity, which is unknown at the start and then changes by
/// little from frame to frame. A known velocity narrows the search of the next frame to a few pixels,
/// and so keeps trunks apart that look alike. Along one direction ("up": what the trunks do not tell) the
/// velocity is never seen; the camera is expected to stay there, since what is not measured must not be integrated.
///
/// Frames: pose cMo; covariances of the camera's twist (m, rad; camera frame); velocity in metres a frame, object
/// frame.
///
/// \code
/// CameraMotion motion;
/// motion.start(cMo, covariance);
/// CameraMotion::Expected expected = motion.predict(1, c2Rc1, 0.006, up);
/// motion.update(measured_cMo, measured_covariance); // of that frame, the expectation included
/// \endcode

#include <bole/pose.h>

namespace bole
{
class CameraMotion
{
public:
  struct Options
  {
    double step_sigma_m = 0.12;  ///< of the velocity while it is unknown, metres a frame and axis
    double accel_sigma_m = 0.03; ///< by how much it changes, metres a frame, from one frame to the next
    double climb_sigma_m = 0.03; ///< steps along what is not seen
  };
  struct Expected
  {
    Pose cMo;
    Matrix6d covariance = Matrix6d::Zero();
  };

  CameraMotion() : CameraMotion(Options()) {}
  explicit CameraMotion(const Options &options) : m_options(options) {}

  /// The camera stands at \p cMo, its velocity is not known.
  void start(const Pose &cMo, const Matrix6d &covariance);
  /// \p frames after the last update (1 ..), turned by \p c2Rc1 since then (\p turn_sigma_rad about each axis); \p up:
  /// unit, object frame.
  Expected predict(int frames, const Eigen::Matrix3d &c2Rc1, double turn_sigma_rad, const Eigen::Vector3d &up);
  /// What the frame of the last predict() made of the expectation; the covariance has taken it in already.
  void update(const Pose &cMo, const Matrix6d &covariance);
  /// A pose that did not use predict(), \p frames after the last update.
  void replace(const Pose &cMo, const Matrix6d &covariance, int frames);
  const Eigen::Vector3d &velocity() const { return m_velocity; }

private:
  using Matrix63d = Eigen::Matrix<double, 6, 3>;

  Options m_options;
  Pose m_cMo, m_expected;
  Matrix6d m_covariance = Matrix6d::Zero(), m_expected_covariance = Matrix6d::Identity();
  Eigen::Vector3d m_velocity = Eigen::Vector3d::Zero();
  Eigen::Matrix3d m_velocity_covariance = Eigen::Matrix3d::Zero(),
                  m_expected_velocity_covariance = Eigen::Matrix3d::Zero();
  Matrix63d m_cross = Matrix63d::Zero(), m_expected_cross = Matrix63d::Zero(); ///< pose and velocity
};
} // namespace bole
