// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether what is stated of camera and gyro can be true: focal lengths, attitude of the camera on the body, scale of
/// the rates.

#include "geometry/constants.h"
#include "input/frame_builder.h"
#include "motion/calibration_fit.h"
#include "motion/gyro.h"

namespace bole::calibration
{
/// The rotation of the body over an interval, by points.
struct Turn
{
  std::int64_t a_ns = 0, b_ns = 0;
  Eigen::Matrix3d aRb = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero(); ///< without that of the gyro's noise
  double duration() const { return secondsOf(b_ns - a_ns); }
};

/// The bias of a gyro that is \p late_s, by the rotations of the points.
/// \param scatter of the noise; 0: that of what is left
Fitted fitBias(const GyroTurns &gyro, const std::vector<Turn> &turns, double late_s, double overlap, double scatter);

/// A camera file or a scale of the gyro under which images and gyro would agree, in both halves of \p turns; empty
/// where they do as it is. Nothing is corrected: the numbers are the user's. SensorVerdict::since_s is left at 0.
/// \param gyro less its bias
/// \param bRc attitude of the camera on the body, as stated
/// \param overlap turns that share an interval of time
std::vector<SensorVerdict> judgeCamera(const GyroTurns &gyro, const std::vector<Turn> &turns,
                                       const Eigen::Matrix3d &bRc, double overlap);
} // namespace bole::calibration
