// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Constant errors of gyro, odometry and clocks from the first seconds of a recording.
///
/// Idea: what points say of the rotation and of the direction of flight rests on the images alone, so each constant of
/// a sensor is the one under which that sensor agrees with them:
/// - gyro: offset of its clock and bias, by its rotations against those of the points;
/// - odometry: rotation of its body against the camera's, by its direction of flight against that of the points, its
///   gravity against the accelerometer's, and its rotations against the gyro's; offset of its clock, by its rotations
///   against the gyro's; scale of its horizontal lengths, by the accelerometer (MotionFilter).
/// All are robust least squares. The prior of each has two parts: as the sensor is stated (narrow), or anything within
/// kMost... (wide). A constant is taken over where the wide part explains the measurements better, so a sensor that is
/// as stated is read as it stands, and the constants that are taken over carry the covariance of their measurement.
/// Focal lengths and attitude of the camera and the scale of the gyro are not taken over but named (SensorVerdict),
/// where under another one the points' rotations would agree with the gyro's: they are the user's. A fault that begins
/// later is no constant: what the constants do not explain is left alone, for MotionFilter.
///
/// Frames: b body, w world, o the body as the odometry has it: wRo = wRb * bRo.
///
/// Laws (each a test): exact sensors leave all as stated; each constant that was put into a flight comes back within
/// three standard deviations; of a fault that begins in the middle nothing is taken over.

#include "input/frame_builder.h"
#include "motion/point_motion.h"

#include <vector>

namespace bole
{
class SensorCalibrator
{
public:
  explicit SensorCalibrator(const Pose &bMc, const GyroOptions &gyro = {});

  /// The next frame (its image is not looked at) and, where there is one, what points alone say of the motion to it:
  /// RelativeMotion::points, a_index and b_index counting the frames that were added.
  void add(const Frame &frame, const std::optional<RelativeMotion> &motion);
  double duration_s() const;

  SensorCalibration estimate() const;

private:
  Pose m_bMc;
  GyroOptions m_gyro;
  std::vector<Frame> m_frames; ///< without images
  std::vector<RelativeMotion> m_motions;
};

/// Looks through the first seconds of \p source, which it consumes, and estimates. As stated where the source has
/// neither gyro nor odometry that is to be used.
SensorCalibration calibrateSensors(FrameSource &source, bool use_gyro = true, bool use_odometry = true);
} // namespace bole
