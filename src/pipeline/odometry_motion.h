// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Motion from a pose filter, a gyro and points, of which any may be missing.

#include "pipeline/motion_source.h"

#include "motion/inertial_scale.h"
#include "motion/sensor_monitor.h"

namespace bole
{
/// The pose filter gives the translation, the gyro the rotation, and points relative poses against earlier frames. The
/// scale of the odometry comes from the accelerometer where there is one, and so do its steps while the filter is
/// silent. A sensor that contradicts the others is left out until it agrees with them again.
class OdometryMotion : public MotionSource
{
public:
  /// \p has_odometry: false where nothing but a constant velocity stands in for the pose filter.
  OdometryMotion(const PinholeCamera &camera, const Pose &bMc, bool has_odometry, const StageOptions &options);

  PosePrior first(const Frame &frame) override;
  Motion step(const Frame &frame, const Pose &wMa, const Vector6d &velocity) override;
  bool isTranslationMeasured() const override { return m_has_odometry; }
  std::optional<double> groundZ() const override;
  ScaleEstimate scale() const override;
  std::vector<SensorVerdict> verdicts() const override { return m_monitor.verdicts(); }
  WorldReference reference() const override;

private:
  std::vector<RelativeMotion> observe(const Frame &frame);
  void addPoints(Motion &motion, const std::vector<RelativeMotion> &seen) const;

  Pose m_bMc;
  bool m_has_odometry, m_use_points;
  double m_scale_sigma;
  MotionModel m_model;
  InertialScale m_inertial;                    ///< scale of the odometry; stands in for it
  std::optional<InertialStep> m_inertial_step; ///< to the frame at hand, where the pose filter is silent
  SensorMonitor m_monitor;
  std::int64_t m_last_ns = 0; ///< stamp of the frame before
};
} // namespace bole
