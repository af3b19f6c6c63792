// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Motion from the images alone, in place of a pose filter.
///
/// Idea: PointOdometry places every frame in a unit of length of its own, the edges of the trunks tell the direction of
/// gravity, and points of the ground tell how many units the camera is over the ground. The unit of this motion is a
/// first guess of a metre, made when the first parallax is seen, and is kept: scale() estimates its error.
///
/// Frames: w level with the first camera at its origin, a the body at the frame before, b the body now.
/// A camera that only rotates gets its rotation; its place is held until some parallax says otherwise.
/// Motion between earlier frames that becomes known later (first baseline, frames after a gap) is added as further
/// odometry.

#include "motion/ground_plane.h"
#include "motion/point_odometry.h"
#include "motion/sensor_monitor.h"
#include "motion/vertical.h"
#include "pipeline/motion_source.h"

namespace bole
{
class MonocularMotion : public MotionSource
{
public:
  MonocularMotion(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options);

  PosePrior first(const Frame &frame) override;
  Motion step(const Frame &frame, const Pose &wMa, const Vector6d &velocity) override;
  int iterations(int asked) const override;
  bool hasRanges() const override { return m_has_unit; }
  bool isTranslationMeasured() const override { return m_has_unit; }
  std::optional<double> groundZ() const override { return m_ground_z; }
  /// By the height over the ground: that of the options where it is known, else one that is usual.
  ScaleEstimate scale() const override;
  WorldReference reference() const override;
  std::vector<SensorVerdict> verdicts() const override;

private:
  MotionStep predictStep(const Frame &frame, const Pose &wMa, const Vector6d &velocity);
  void compareGyro(const Frame &frame);
  void useImageMotion(const Frame &frame, const Pose &wMa, Motion &motion);
  PointOdometryResult placeFrame(const Frame &frame, const std::optional<GyroRotation> &rotated);
  void chooseUnit();
  void measureHeight();
  void updateGround(const Pose &wMb);
  Odometry toBody(const Pose &caMcb, Matrix6d covariance, bool is_held) const;
  void addEarlierFrames(Motion &motion) const;
  bool isHeightKnown() const { return m_camera_height > 0; }
  std::optional<Eigen::Vector3d> up() const;
  double upSigma() const; ///< [rad]

  PinholeCamera m_camera;
  Pose m_bMc;
  double m_camera_height; ///< over the ground [m]; 0: unknown
  double m_focal_sigma;   ///< of the log of the focal length
  MotionModel m_model;    ///< for the gyro, and for what the images do not show
  PointOdometry m_odometry;
  SensorMonitor m_monitor; ///< of the gyro, by the points
  VerticalFinder m_verticals;
  VerticalFilter m_vertical; ///< in the world of m_odometry
  ScaleFromHeight m_height_scale;
  std::size_t m_frame = 0;                   ///< number of the frame at hand
  std::vector<std::size_t> m_placed;         ///< numbers of the frames placed
  Pose m_pointsMc;                           ///< the last frame placed, in units of m_odometry
  std::optional<Eigen::Vector3d> m_first_up; ///< up in the last camera while m_vertical is not known
  std::optional<double> m_height_seen;       ///< of the camera over the ground in the last frame, where it was seen
  std::optional<double> m_ground_z;
  std::optional<double> m_odometry_from_s; ///< first stamp of an odometry that began too late
  double m_unit = 1;                       ///< of this motion, for one of m_odometry
  int m_frames_with_up = 0;
  bool m_has_unit = false;
};
} // namespace bole
