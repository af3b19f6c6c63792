// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/odometry_motion.h"

#include "pipeline/monocular_motion.h"

namespace bole
{
namespace
{
/// A camera that only rotates, without a gyro: points give its rotation, and nothing of its translation.
Odometry rotationAlone(const RelativePoseEstimate &estimate, const Pose &bMc)
{
  constexpr double kUnknown = 1e4, kLeast = 1e-8; // variances [m^2], [rad^2]
  Odometry odometry;
  odometry.aMb.R = bMc.R * estimate.aRb * bMc.R.transpose();
  odometry.covariance.setZero();
  odometry.covariance.topLeftCorner<3, 3>() = kUnknown * Eigen::Matrix3d::Identity();
  odometry.covariance.bottomRightCorner<3, 3>() =
      bMc.R * estimate.covariance.topLeftCorner<3, 3>() * bMc.R.transpose() + kLeast * Eigen::Matrix3d::Identity();
  return odometry;
}

/// The motions by points alone, for a frame whose gyro is rejected.
std::vector<RelativeMotion> pointsAlone(std::vector<RelativeMotion> seen)
{
  for (RelativeMotion &motion : seen)
    if (motion.gyro) {
      motion.estimate = motion.points;
      motion.gyro.reset();
    }
  return seen;
}
} // namespace

OdometryMotion::OdometryMotion(const PinholeCamera &camera, const Pose &bMc, bool has_odometry,
                               const StageOptions &options)
    : MotionSource(camera, bMc, options.points),
      m_bMc(bMc),
      m_has_odometry(has_odometry),
      m_use_points(options.flow.use_points),
      m_scale_sigma(options.motion.scale_sigma),
      m_model(options.motion, options.points.gyro),
      m_inertial(bMc, options.points.gyro),
      m_monitor(bMc)
{
}

PosePrior OdometryMotion::first(const Frame &frame)
{
  observe(frame);
  const PosePrior prior = m_model.first(frame);
  m_model.advance(frame);
  return prior;
}

/// Measures the motion by points, compares the sensors with it, and returns what may be used.
std::vector<RelativeMotion> OdometryMotion::observe(const Frame &frame)
{
  std::vector<RelativeMotion> seen;
  Frame scratch;
  if (m_use_points)
    seen = m_points.process(m_monitor.withoutRejectedSensors(frame, scratch));
  m_monitor.process(frame, seen);
  if (!m_monitor.trustsNow(Sensor::gyro))
    seen = pointsAlone(std::move(seen));
  else if (m_monitor.trustsNow(Sensor::images))
    m_points.learn(seen);
  const Frame &trusted = m_monitor.trusted(frame, scratch);
  m_inertial_step = trusted.wMb_odometry ? std::nullopt : m_inertial.stepTo(trusted, m_last_ns);
  m_inertial.process(trusted, seen);
  m_last_ns = frame.stamp_ns;
  return seen;
}

Motion OdometryMotion::step(const Frame &frame, const Pose &wMa, const Vector6d &velocity)
{
  Motion motion;
  const GyroBias bias = m_points.gyroBias(); // as before this frame, whose points will teach it
  const std::vector<RelativeMotion> seen = observe(frame);
  motion.image_fault = m_points.fault();
  Frame scratch;
  const Frame &trusted = m_monitor.trusted(frame, scratch);
  motion.step = m_model.step(trusted, wMa, bias, velocity, m_inertial_step);
  motion.is_odometry_used = trusted.wMb_odometry.has_value();
  motion.is_rotation_seen = motion.step.is_step_measured || !trusted.gyro.empty();
  if (m_monitor.trustsNow(Sensor::images))
    addPoints(motion, seen);
  m_model.advance(frame);
  return motion;
}

void OdometryMotion::addPoints(Motion &motion, const std::vector<RelativeMotion> &seen) const
{
  for (const RelativeMotion &relative : seen) {
    const RelativePoseEstimate &estimate = relative.estimate;
    if (estimate.hasDirection())
      motion.directions.push_back(
          {relative.a_index, relative.b_index, {estimate.aRb, estimate.direction, estimate.covariance}});
    else if (estimate.hasRotation() && !relative.gyro)
      motion.odometry.push_back({relative.a_index, relative.b_index, rotationAlone(estimate, m_bMc)});
  }
}

std::optional<double> OdometryMotion::groundZ() const
{
  return m_has_odometry ? std::optional<double>(0.0) : std::nullopt;
}

ScaleEstimate OdometryMotion::scale() const
{
  if (const auto measured = m_has_odometry ? m_inertial.scale(m_scale_sigma) : std::nullopt)
    return {-measured->mean, measured->sigma, ScaleSource::odometry};
  return {0, m_scale_sigma, ScaleSource::odometry};
}

WorldReference OdometryMotion::reference() const
{
  WorldReference reference;
  if (!m_has_odometry) {
    reference.scale = ScaleSource::prior;
    reference.gravity = GravitySource::assumed;
  }
  return reference;
}

std::unique_ptr<MotionSource> makeMotionSource(const Frame &first, const PinholeCamera &camera, const Pose &bMc,
                                               const StageOptions &options)
{
  if (!first.wMb_odometry && options.flow.use_points)
    return std::make_unique<MonocularMotion>(camera, bMc, options);
  return std::make_unique<OdometryMotion>(camera, bMc, first.wMb_odometry.has_value(), options);
}
} // namespace bole
