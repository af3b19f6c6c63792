// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the sensors say of the motion between two frames, as the smoother wants it.
///
/// Idea: a pose filter's errors are not one random walk. Its horizontal steps are (optical flow on the ground: noise of
/// a centimetre a frame, a scale that is off by some per cent), but its height (sonar) and its roll and pitch (gravity)
/// stay about the truth, and its yaw scatters where a gyro hardly moves. So the rotation of a step comes from the gyro
/// where there is one, the translation from the filter, and height, roll and pitch enter as measurements of the pose
/// itself.
///
/// Frames: a the body at the frame before, b the body now, w world.

#include "motion/motion_filter.h"
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
  double height_sigma = 0.02; ///< of the filter's height round the truth [m], 1e-3 to 10, beside what it wanders by
  double tilt_sigma = 0.005;  ///< of the filter's roll and pitch round the truth [rad], 1e-4 to 1
  double turn_sigma = 0.006;  ///< of the filter's rotation between frames, used without gyro [rad], 1e-5 to 1
  double gyro_turn_sigma = 0.0008; ///< least walk of the gyro's rotation in 0.1 s [rad], 1e-6 to 1
  bool relative_alone = false;     ///< the filter's relative pose and nothing else: no gyro, no height, roll or pitch
  double free_step_sigma = 0.15;   ///< of 0.1 s that nothing measured (constant velocity) [m], 1e-3 to 10; as the time
  double free_turn_sigma = 0.02;   ///< of a turn of 0.1 s that nothing measured [rad], 1e-4 to 1; as the time
};

/// What a pose filter says of a frame, as far as it is believed.
struct FilterSays
{
  std::optional<Pose> aMb;           ///< the step to the frame
  std::optional<FreeStep> free_step; ///< stands in for its translation
  std::optional<Pose> wMb;           ///< for roll, pitch and height
  bool has_turn = true, has_tilt = true, has_height = true;
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

  /// The step from the frame of the last call (or of first()) to \p frame, of which the gyro alone is read. \p wMa: the
  /// pose there as it is known now; \p velocity: of the body in its own frame as it is known, for what nothing
  /// measured.
  MotionStep step(const Frame &frame, const Pose &wMa, const GyroBias &bias, const Vector6d &velocity,
                  const FilterSays &filter = {});

  /// Of a motion \p aMb that a pose filter told over \p seconds, its rotation too or not.
  Matrix6d odometryCovariance(const Pose &aMb, double seconds, bool has_turn) const;

  /// Remembers \p frame as the one the next step starts from.
  void advance(const Frame &frame) { m_stamp_ns = frame.stamp_ns; }

private:
  PosePrior levelPrior(const FilterSays &filter, const Eigen::Matrix3d &wRb_yaw, double dt) const;

  MotionModelOptions m_options;
  GyroOptions m_gyro;
  std::int64_t m_stamp_ns = 0;
};
} // namespace bole
