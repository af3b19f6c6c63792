// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The motion between two frames by the sensors, with its covariance, as a measurement for the smoother.
///
/// Idea: a pose filter's errors are not one random walk. Its horizontal steps are (optical flow on the ground: noise of
/// a centimetre a frame, a scale that is off by some per cent), but its height (sonar) and its roll and pitch (gravity)
/// scatter round the truth and do not drift, and its yaw scatters too where a gyro hardly moves. So the rotation of a
/// step comes from the gyro where there is one, the translation from the filter, and height, roll and pitch enter as
/// measurements of the pose itself.
///
/// Frames: a the body at the frame before, b the body now, w world.

#include "motion/inertial_scale.h"
#include "smoothing/factors.h"
#include <bole/frame.h>

#include <optional>

namespace bole
{
/// What walks is stated for 0.1 s and grows with the root of the time, whatever the rate of the frames.
struct MotionModelOptions
{
  double step_sigma = 0.012;         ///< horizontal walk of the pose filter in 0.1 s [m], 1e-4 to 1
  double step_scale_sigma = 0.03;    ///< error in proportion to the way of 0.1 s, 0 to 1
  double scale_sigma = 0.03;         ///< of the one scale by which all steps of the filter are off, 0 to 1
  double step_sigma_vertical = 0.03; ///< of the difference of two heights [m], 1e-4 to 1
  double height_sigma = 0.02; ///< of the filter's height round the truth [m], 1e-3 to 10; bumps of the ground too
  double tilt_sigma = 0.005;  ///< of the filter's roll and pitch round the truth [rad], 1e-4 to 1
  double turn_sigma = 0.006;  ///< of the filter's rotation between frames, used without gyro [rad], 1e-5 to 1
};

/// One step: what the smoother is given for a new frame.
struct MotionStep
{
  Pose aMb;
  Matrix6d covariance = Matrix6d::Identity(); ///< of (rho, phi) at aMb
  std::optional<PosePrior> absolute;          ///< height, roll and pitch of b in the world
  bool turn_from_gyro = false;
  bool is_step_measured = false; ///< by the pose filter, the accelerometer or points
};

class MotionModel
{
public:
  explicit MotionModel(const MotionModelOptions &options = {}, const GyroOptions &gyro = {});

  /// Pose and covariance of the first frame.
  PosePrior first(const Frame &frame) const;

  /// The step from the frame of the last call (or of first()) to \p frame. \p wMa: the pose there as it is known now;
  /// \p velocity: of the body in its own frame as it is known, for what nothing measured; \p inertial: what stands in
  /// for a pose filter that is silent.
  MotionStep step(const Frame &frame, const Pose &wMa, const GyroBias &bias, const Vector6d &velocity,
                  const std::optional<InertialStep> &inertial = {});

  /// Remembers \p frame as the one the next step starts from.
  void advance(const Frame &frame);

private:
  MotionModelOptions m_options;
  GyroOptions m_gyro;
  std::optional<Pose> m_odometry; ///< at the last frame
  std::int64_t m_stamp_ns = 0;
};
} // namespace bole
