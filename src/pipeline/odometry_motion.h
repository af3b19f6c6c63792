// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Motion from a pose filter, a gyro and points, of which any may be missing.

#include "pipeline/motion_source.h"

#include "motion/motion_filter.h"

namespace bole
{
/// The pose filter gives the translation, the gyro the rotation, and points relative poses against earlier frames. The
/// scale of the path comes from the accelerometer where there is one, and so do its steps while the filter is silent.
/// What contradicts the others is left out of its frame (MotionFilter).
class OdometryMotion : public MotionSource
{
public:
  /// \p has_odometry: false where nothing but a constant velocity stands in for the pose filter. \p first: number of
  /// the first frame.
  OdometryMotion(const PinholeCamera &camera, const Pose &bMc, bool has_odometry, const StageOptions &options,
                 std::size_t first = 0);

  PosePrior first(const Frame &frame) override;
  Motion step(const Frame &frame, const Pose &wMa, const Vector6d &velocity) override;
  bool isTranslationMeasured() const override { return m_has_odometry; }
  std::optional<double> groundZ() const override;
  void measureScale(const PathScale::Path &path) override;
  ScaleEstimate scale() const override;
  std::vector<SensorVerdict> verdicts() const override { return m_filter.verdicts(); }
  WorldReference reference() const override;

private:
  std::vector<RelativeMotion> observe(const Frame &frame);
  FilterSays says(const Frame &frame) const;
  void addPoints(Motion &motion, const std::vector<RelativeMotion> &seen) const;

  Pose m_bMc;
  bool m_has_odometry, m_use_points, m_odometry_alone;
  double m_scale_sigma;
  MotionModel m_model;
  PathScale m_path_scale;          ///< by the accelerometer
  std::optional<LogScale> m_scale; ///< of the path, when measured last
  MotionFilter m_filter;
  std::optional<Pose> m_last_odometry; ///< at the frame before
  std::size_t m_frame = 0;             ///< number of the frame at hand
};
} // namespace bole
