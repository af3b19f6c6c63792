// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether what is stated of camera and gyro can be true: lens, focal lengths, attitude of the camera on the body,
/// scale of the rates.

#include "geometry/constants.h"
#include "input/frame_builder.h"
#include "motion/calibration_fit.h"
#include "motion/gyro.h"
#include "motion/point_tracker.h"

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

/// The radial distortion k1 beside that which was taken out under which the points of many pairs of frames would agree
/// much more closely with a motion of the camera; nothing where they agree as it is, or where the images do not tell.
/// \param pairs the matches of pairs of frames between which the camera moved
/// \param is_focal_known false: the focal length of \p camera is a guess; another may be the true one
std::optional<double> findDistortion(const std::vector<std::vector<PointMatch>> &pairs, const PinholeCamera &camera,
                                     bool is_focal_known = true);

/// A camera file or a scale of the gyro under which images and gyro would agree, in both halves of \p turns; empty
/// where they do as it is. Nothing is corrected: the numbers are the user's. SensorVerdict::since_s is left at 0.
/// \param gyro less its bias
/// \param bRc attitude of the camera on the body, as stated
/// \param overlap turns that share an interval of time
std::vector<SensorVerdict> judgeCamera(const GyroTurns &gyro, const std::vector<Turn> &turns,
                                       const Eigen::Matrix3d &bRc, double overlap);
} // namespace bole::calibration
