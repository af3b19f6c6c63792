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

/// What the points say without a gyro or an odometry that is not believed.
std::vector<RelativeMotion> pointsAlone(std::vector<RelativeMotion> seen)
{
  for (RelativeMotion &motion : seen)
    if (motion.gyro || motion.odometry) {
      motion.estimate = motion.points;
      motion.gyro.reset();
    }
  return seen;
}
} // namespace

OdometryMotion::OdometryMotion(const PinholeCamera &camera, const Pose &bMc, bool has_odometry,
                               const StageOptions &options, std::size_t first)
    : MotionSource(camera, bMc, options.points),
      m_bMc(bMc),
      m_has_odometry(has_odometry),
      m_use_points(options.flow.use_points),
      m_odometry_alone(options.motion.relative_alone),
      m_scale_sigma(options.motion.scale_sigma),
      m_model(options.motion, options.points.gyro),
      m_path_scale(options.points.gyro,
                   options.flow.use_points ? PathScale::kWalkAmongTrees : options.points.odometry_walk, first),
      m_filter(bMc, options.points.gyro, first),
      m_frame(first)
{
  m_points.skip(first);
}

PosePrior OdometryMotion::first(const Frame &frame)
{
  observe(frame);
  PosePrior prior = m_model.first(frame);
  if (!m_odometry_alone)
    prior.mean = m_filter.odometryPose(frame).value_or(prior.mean);
  m_model.advance(frame);
  m_last_odometry = frame.wMb_odometry;
  return prior;
}

/// The motion by the points; the sensors are compared with it.
std::vector<RelativeMotion> OdometryMotion::observe(const Frame &frame)
{
  std::vector<RelativeMotion> seen;
  if (m_odometry_alone)
    return seen;
  Frame room;
  const Frame &expected = m_filter.expect(frame, room);
  if (m_use_points)
    seen = m_points.process(expected);
  m_filter.process(frame, seen);
  if (!m_filter.believes(Source::gyro) || !m_filter.believes(Source::odometry_step))
    seen = pointsAlone(std::move(seen));
  m_points.setGyroBias(m_filter.gyroBias());
  Frame inertial;
  inertial.stamp_ns = frame.stamp_ns;
  if (m_filter.believes(Source::odometry_tilt))
    inertial.wMb_odometry = m_filter.odometryPose(frame);
  if (m_filter.believes(Source::gyro) && m_filter.believes(Source::accelerometer))
    inertial.gyro = frame.gyro;
  m_path_scale.add(inertial);
  return seen;
}

/// What of the pose filter is believed in the frame observed last.
FilterSays OdometryMotion::says(const Frame &frame) const
{
  FilterSays filter;
  if (m_odometry_alone) {
    if (m_last_odometry && frame.wMb_odometry)
      filter.aMb = m_last_odometry->inverse() * *frame.wMb_odometry;
    return filter;
  }
  if (const auto &step = m_filter.odometryStep(); step && step->a + 1 == m_frame)
    filter.aMb = step->aMb;
  if (m_has_odometry)
    filter.free_step = m_filter.freeStep();
  filter.wMb = m_filter.odometryPose(frame);
  filter.has_turn = m_filter.believes(Source::odometry_turn);
  filter.has_tilt = m_filter.believes(Source::odometry_tilt);
  filter.has_height = m_filter.believes(Source::odometry_height);
  return filter;
}

Motion OdometryMotion::step(const Frame &frame, const Pose &wMa, const Vector6d &velocity)
{
  Motion motion;
  ++m_frame;
  const GyroBias bias = m_points.gyroBias(); // as before this frame, whose points will teach it
  const std::vector<RelativeMotion> seen = observe(frame);
  motion.image_fault = m_points.fault();
  Frame room;
  const Frame &believed = m_filter.believed(frame, room);
  motion.step = m_model.step(believed, wMa, bias, velocity, says(frame));
  motion.is_odometry_used = frame.wMb_odometry && m_filter.believes(Source::odometry_step);
  motion.is_rotation_seen = motion.step.is_step_measured || !believed.gyro.empty();
  if (const auto &step = m_filter.odometryStep(); step && step->a + 1 < m_frame) // over frames that it did not tell
    motion.odometry.push_back({step->a,
                               m_frame,
                               {step->aMb, m_model.odometryCovariance(step->aMb, step->duration_s,
                                                                      m_filter.believes(Source::odometry_turn))}});
  if (m_filter.believes(Source::points))
    addPoints(motion, seen);
  m_model.advance(frame);
  m_last_odometry = frame.wMb_odometry;
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

void OdometryMotion::measureScale(const PathScale::Path &path)
{
  if (m_has_odometry)
    m_scale = m_path_scale.measure(path, m_scale_sigma);
}

ScaleEstimate OdometryMotion::scale() const
{
  if (m_scale)
    return {-m_scale->mean, m_scale->sigma, ScaleSource::odometry};
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
                                               const StageOptions &options, std::size_t number)
{
  if (!first.wMb_odometry && options.flow.use_points)
    return std::make_unique<MonocularMotion>(camera, bMc, options);
  return std::make_unique<OdometryMotion>(camera, bMc, first.wMb_odometry.has_value(), options, number);
}
} // namespace bole
