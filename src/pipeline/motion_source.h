// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where the motion of the camera comes from: a pose filter with gyro and points, or the images alone.
///
/// Frames: w world, a body at the frame before, b body now. Poses are counted from 0, one for each frame.

#include "pipeline/motion_model.h"
#include "pipeline/stage_options.h"
#include <bole/report.h>
#include <bole/trunk_record.h>

#include "motion/point_motion.h"

#include <memory>
#include <string>

namespace bole
{
/// The relative pose of the body between two frames.
struct OdometryBetween
{
  std::size_t a = 0, b = 0; ///< poses
  Odometry odometry;
};

/// Rotation and direction of translation of the camera between two frames, from points.
struct DirectionBetween
{
  std::size_t a = 0, b = 0; ///< poses
  RelativePoseMeasurement measurement;
};

/// What is known of the motion to a new frame.
struct Motion
{
  std::optional<PosePrior> start;        ///< of the first frame, instead of a step
  MotionStep step;                       ///< from the frame before
  std::vector<OdometryBetween> odometry; ///< further relative poses, also between earlier frames
  std::vector<DirectionBetween> directions;
  bool is_odometry_used = false; ///< of the frame
  bool is_rotation_seen = false; ///< by gyro, pose filter or points; else it is only expected
  std::string image_fault;       ///< why the image of the frame is not used, by its points; empty where it is
  bool has_new_unit = false;     ///< the first parallax came with this frame: ranges before it were guesses
};

/// The scale of all lengths together.
struct ScaleEstimate
{
  double log_scale = 0; ///< log of metres for one unit of length of the motion
  double sigma = 0;     ///< standard deviation of log_scale
  ScaleSource source = ScaleSource::odometry;
};

class MotionSource
{
public:
  MotionSource(const PinholeCamera &camera, const Pose &bMc, const PointMotionOptions &options)
      : m_points(camera, bMc, options)
  {
  }
  virtual ~MotionSource() = default;

  /// Pose and covariance of the first frame.
  virtual PosePrior first(const Frame &frame) = 0;
  /// The motion to \p frame. \p wMa: the pose of the frame before as it is known now; \p velocity: of the body in its
  /// own frame [m/s, rad/s], for what nothing measured.
  virtual Motion step(const Frame &frame, const Pose &wMa, const Vector6d &velocity) = 0;

  /// Gauss-Newton iterations that a frame may take, given those of the options.
  virtual int iterations(int asked) const { return asked; }
  /// False while the camera has only rotated: trunks have a bearing and a width, but no range.
  virtual bool hasRanges() const { return true; }
  /// Whether the views of a window stand apart by known translations.
  virtual bool isTranslationMeasured() const = 0;
  /// Height of the ground in the world [units of the motion], where it is known.
  virtual std::optional<double> groundZ() const = 0;
  /// The scale as the motion source estimates it by itself.
  virtual ScaleEstimate scale() const = 0;
  /// Sensors that contradicted the others so far.
  virtual std::vector<SensorVerdict> verdicts() const { return {}; }
  /// Gravity and ranges; the scale as scale() says.
  virtual WorldReference reference() const = 0;

  const PointMotion &points() const { return m_points; }

protected:
  PointMotion m_points;
};

/// The source for a flight that begins with \p first: images alone where it has no odometry.
std::unique_ptr<MotionSource> makeMotionSource(const Frame &first, const PinholeCamera &camera, const Pose &bMc,
                                               const StageOptions &options);
} // namespace bole
