// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Constant errors of gyro, odometry and clocks from the first seconds of a recording.
///
/// Idea: what points say of the rotation and of the direction of flight rests on the images alone, so each constant of
/// a sensor is the one under which that sensor agrees with them:
/// - gyro: offset of its clock and bias, by its rotations against those of the points;
/// - odometry and accelerometer together: rotation of the odometry's body against the camera's and bias of the
///   accelerometer, by the odometry's direction of flight against that of the points, its gravity against the
///   accelerometer's, and its rotations against the gyro's;
/// - odometry: offset of its clock, by its rotations against the gyro's; scale of its horizontal lengths, by the
///   accelerometer (InertialScale).
/// All are robust least squares. The prior of each has two parts: as the sensor is stated (narrow), or anything within
/// kMost... (wide). A constant is taken over where the wide part explains the measurements better, so a sensor that is
/// as stated is read as it stands, and the constants that are taken over carry the covariance of their measurement.
/// Focal lengths and attitude of the camera and the scale of the gyro are not taken over but named (SensorVerdict),
/// where under another one the points' rotations would agree with the gyro's: they are the user's. A fault that begins
/// later is no constant: what the constants do not explain is left alone, for SensorMonitor.
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
/// The constants by \p frames (images are not looked at) and by what points alone say of \p motions between them:
/// RelativeMotion::points, a_index and b_index counting the frames.
SensorCalibration calibrate(const std::vector<Frame> &frames, const std::vector<RelativeMotion> &motions,
                            const Pose &bMc);

/// Looks through the first seconds of \p source, which it consumes, judges its lens and estimates. As stated where the
/// lens is not, or where the source has neither gyro nor odometry that is to be used.
SensorCalibration calibrateSensors(FrameSource &source, bool use_gyro = true, bool use_odometry = true);
} // namespace bole
