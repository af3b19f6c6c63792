// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/visual_odometry.h"

#include "geometry/median.h"
#include "geometry/require_range.h"
#include "geometry/so3.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

void VisualOdometryOptions::validate() const
{
  requireRange("visual.camera_height", camera_height, 0, 100);
  requireRange("visual.camera_height_sigma", camera_height_sigma, 1e-3, 1);
  requireRange("visual.start_height", start_height, 0.1, 100);
  requireRange("visual.start_depth", start_depth, 0.5, 1000);
  requireRange("visual.start_sigma", start_sigma, 0.05, 5);
  requireRange("visual.step_sigma", step_sigma, 1e-5, 1);
  requireRange("visual.step_scale_sigma", step_scale_sigma, 0, 1);
  requireRange("visual.turn_sigma", turn_sigma, 1e-6, 1);
  requireRange("visual.still_sigma", still_sigma, 1e-4, 10);
  requireRange("visual.max_iterations", max_iterations, 1, 100);
}

namespace
{
PointOdometryOptions withFocal(bool is_known)
{
  PointOdometryOptions options;
  options.focal_known = is_known;
  return options;
}

/// \p wRb turned, as little as needed, to have \p bup pointing up.
Matrix3d levelled(const Matrix3d &wRb, const Vector3d &bup)
{
  return Eigen::Quaterniond::FromTwoVectors(wRb * bup, Vector3d::UnitZ()).toRotationMatrix() * wRb;
}

/// Roll and pitch alone, at the body \p wMb with up in the direction \p bup.
PosePrior tiltPrior(const Pose &wMb, const Vector3d &bup, double sigma)
{
  PosePrior prior;
  prior.mean = Pose(levelled(wMb.R, bup), wMb.t);
  const Matrix3d bRw = prior.mean.R.transpose();
  prior.covariance.setZero();
  prior.covariance.topLeftCorner<3, 3>() = 1e4 * Matrix3d::Identity();
  prior.covariance.bottomRightCorner<3, 3>() =
      bRw * Vector3d(sigma * sigma, sigma * sigma, 10).asDiagonal() * bRw.transpose();
  return prior;
}

} // namespace

VisualOdometry::VisualOdometry(const PinholeCamera &camera, const Pose &bMc, const VisualOdometryOptions &options)
    : m_camera(camera), m_bMc(bMc), m_options(options), m_points(camera, withFocal(options.focal_known))
{
  m_options.validate();
}

PosePrior VisualOdometry::first(const Frame &frame, const PointTracker &tracker)
{
  PosePrior prior;
  constexpr double kGuessed = 0.15; // of an image taken to be upright [rad]
  double tilt = kGuessed;
  m_last_index = frame.index;
  if (frame.status == FrameStatus::ok) {
    place(frame, tracker, std::nullopt);
    if (m_first_up) {
      prior.mean.R = levelled(Matrix3d::Identity(), m_bMc.R * *m_first_up);
      tilt = 0.06;
    }
  }
  prior.covariance.setZero();
  prior.covariance.diagonal() << 1e-6, 1e-6, 1e-6, tilt * tilt, tilt * tilt, 1e-6;
  return prior;
}

/// Places the frame by its points, and asks it for up and for its height.
PointOdometryResult VisualOdometry::place(const Frame &frame, const PointTracker &tracker,
                                          const std::optional<GyroRotation> &turned)
{
  const PointOdometryResult placed = m_points.process(tracker, frame.stamp_ns, turned);
  m_pointsMc = placed.wMc;
  m_indices.push_back(frame.index);
  const VerticalEstimate vertical = gravityFromVerticals(frame.image, m_camera, up());
  m_vertical.add(placed.wMc.R, vertical);
  m_frames_with_up += vertical.status == VerticalStatus::ok;
  if (vertical.status == VerticalStatus::ok)
    m_first_up = vertical.up;
  if (!m_has_unit && placed.status == PointOdometryStatus::ok)
    chooseUnit();
  measureHeight();
  return placed;
}

/// Up in the last frame placed.
std::optional<Vector3d> VisualOdometry::up() const
{
  if (!m_vertical.known())
    return std::nullopt;
  return Vector3d(m_pointsMc.R.transpose() * m_vertical.up());
}

double VisualOdometry::upSigma() const { return std::sqrt(0.5 * m_vertical.covariance().trace()); }

/// The first guess of the metre: a height over the ground, or else how deep a forest looks.
void VisualOdometry::chooseUnit()
{
  m_has_unit = true;
  const std::vector<PointDepth> depths = m_points.depths();
  const GroundHeight ground = up() ? heightOverGround(depths, m_camera, *up()) : GroundHeight();
  if (ground.known) {
    m_metres_per_unit =
        (m_options.camera_height > 0 ? m_options.camera_height : m_options.start_height) / ground.height;
  }
  else {
    std::vector<double> inverse;
    for (const PointDepth &point : depths)
      if (point.inverse_depth > 3 * point.sigma)
        inverse.push_back(point.inverse_depth);
    m_metres_per_unit = inverse.empty() ? 1 : m_options.start_depth * medianOf(inverse);
  }
  m_first_metres_per_unit = m_metres_per_unit;
}

void VisualOdometry::measureHeight()
{
  m_height_seen.reset();
  if (!m_has_unit || !up())
    return;
  const GroundHeight ground = heightOverGround(m_points.depths(), m_camera, *up());
  if (!ground.known)
    return;
  m_height_seen = ground.height * m_metres_per_unit;
  const double height = isHeightKnown() ? m_options.camera_height : m_options.start_height;
  m_height_scale.add(ground, height, m_options.camera_height_sigma * height);
}

VisualOdometry::Correction VisualOdometry::fromHeight() const
{
  if (!m_height_scale.known())
    return {std::log(m_first_metres_per_unit / m_metres_per_unit), m_options.start_sigma};
  const double sigma = isHeightKnown() ? m_options.camera_height_sigma : m_options.start_sigma;
  return {std::log(m_height_scale.metresPerUnit() / m_metres_per_unit),
          std::hypot(m_height_scale.relativeSigma(), sigma)};
}

/// The motion of the body in metres. \p is_held: the translation was not seen.
Odometry VisualOdometry::toBody(const Pose &caMcb, Matrix6d covariance, bool is_held) const
{
  const double s = m_metres_per_unit;
  covariance.topRows<3>() *= s;
  covariance.leftCols<3>() *= s;
  const double along = m_options.step_scale_sigma * s * caMcb.t.norm();
  const double least = is_held ? m_options.still_sigma : m_options.step_sigma;
  if (is_held)
    covariance.topRows<3>().setZero(), covariance.leftCols<3>().setZero();
  covariance.topLeftCorner<3, 3>() += (least * least + along * along) * Matrix3d::Identity();
  constexpr double kFocalSigma = 0.15; // of log f where it is guessed: a turn is wrong by as much of itself
  const double guessed = m_options.focal_known ? 0 : kFocalSigma * logSo3(caMcb.R).norm();
  const double turn_variance = m_options.turn_sigma * m_options.turn_sigma + guessed * guessed;
  covariance.bottomRightCorner<3, 3>() += turn_variance * Matrix3d::Identity();
  const Matrix6d to_body = adjoint(m_bMc);
  return {m_bMc * Pose(caMcb.R, s * caMcb.t) * m_bMc.inverse(), to_body * covariance * to_body.transpose()};
}

/// Frames before the first baseline was known, now that they can be placed.
void VisualOdometry::linkBacklog(VisualStep &result) const
{
  const std::vector<PlacedFrame> path = m_points.trajectory();
  std::size_t last = 0;
  while (last + 1 < path.size() && path[last + 1].status != PointOdometryStatus::ok)
    ++last;
  const std::size_t newest = path.size() - 1; // its step comes as such
  for (std::size_t i = last + 1; i < newest; ++i) {
    if (path[i].status != PointOdometryStatus::ok)
      continue;
    result.links.push_back(
        {m_indices[last], m_indices[i], toBody(path[last].wMc.inverse() * path[i].wMc, Matrix6d::Zero(), false)});
    last = i;
  }
  if (last + 1 < newest) // frames in between were not placed
    result.links.push_back({m_indices[last], m_indices[newest],
                            toBody(path[last].wMc.inverse() * path[newest].wMc, Matrix6d::Zero(), false)});
}

VisualStep VisualOdometry::step(const Frame &frame, const PointTracker &tracker, const MotionStep &predicted,
                                const Pose &wMa, const std::optional<GyroRotation> &turned)
{
  VisualStep result;
  result.step = predicted;
  const bool is_next = m_last_index && !m_indices.empty() && m_indices.back() == *m_last_index;
  m_last_index = frame.index;
  if (frame.status != FrameStatus::ok)
    return result;
  const bool had_unit = m_has_unit;
  const Pose before = m_pointsMc;
  const std::size_t before_index = m_indices.empty() ? frame.index : m_indices.back();
  const PointOdometryResult placed = place(frame, tracker, is_next ? turned : std::nullopt);
  if (before_index == frame.index) // the first frame that was ok
    return result;
  const bool is_held = !m_has_unit;
  Pose caMcb = before.inverse() * placed.wMc;
  Matrix6d covariance = placed.covariance;
  if (!had_unit && m_has_unit) {
    const std::vector<PlacedFrame> path = m_points.trajectory();
    caMcb = path[path.size() - 2].wMc.inverse() * path.back().wMc;
    covariance.setZero(); // of the whole way from the start: between two frames of one solution little is left
    linkBacklog(result);
  }
  const Odometry odometry = toBody(caMcb, covariance, is_held);
  if (is_next) {
    result.step.aMb = odometry.aMb;
    result.step.covariance = odometry.covariance;
  }
  else
    result.links.push_back({before_index, frame.index, odometry});
  result.has_length = m_has_unit && placed.status == PointOdometryStatus::ok;
  if (up()) { // frames share the lean of their trunks: the sum over frames must not know more than the filter
    const double sigma = upSigma() * std::sqrt(std::min(30.0, double(m_frames_with_up)));
    result.step.absolute = tiltPrior(wMa * result.step.aMb, m_bMc.R * *up(), sigma);
  }
  return result;
}
} // namespace bole
