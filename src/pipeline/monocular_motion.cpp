// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/monocular_motion.h"

#include "geometry/constants.h"
#include "geometry/direction.h"
#include "geometry/median.h"
#include "geometry/so3.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace
{
constexpr double kCameraHeightSigma = 0.1; ///< of a height that is known, in proportion
constexpr double kStartHeight = 1.5;       ///< taken for the camera's until the trunks say better [m]
constexpr double kStartDepth = 8;          ///< median depth of the points where no ground is seen at the start [m]
constexpr double kStartSigma = 0.5;        ///< of the log of the scale that these two give
constexpr double kStepSigma = 0.004;       ///< least noise of a step [m]
constexpr double kStepScaleSigma = 0.02;   ///< error of a step in proportion to its length
constexpr double kTurnSigma = 0.0004;      ///< least noise of a rotation [rad]
constexpr double kStillSigma = 0.03;       ///< of a step before any parallax was seen [m]
constexpr int kMostIterations = 2;         ///< of the smoother a frame: no pose filter holds the path, so what a false
                                           ///< trunk pulls before it is given up is kept short

/// \p wRb turned, as little as needed, to have \p bup pointing up.
Matrix3d levelled(const Matrix3d &wRb, const Vector3d &bup)
{
  return rotationBetween(wRb * bup, Vector3d::UnitZ()) * wRb;
}

/// Roll and pitch alone, at the body \p wMb with up in the direction \p bup of the \p covariance across it.
PosePrior tiltPrior(const Pose &wMb, const Vector3d &bup, const Matrix3d &covariance)
{
  PosePrior prior;
  prior.mean = Pose(levelled(wMb.R, bup), wMb.t);
  prior.covariance.setZero();
  prior.covariance.topLeftCorner<3, 3>() = 1e4 * Matrix3d::Identity();
  const Matrix3d across = skew(bup); // a direction turns about what is across it
  prior.covariance.bottomRightCorner<3, 3>() = across * covariance * across.transpose() + 10 * bup * bup.transpose();
  return prior;
}
} // namespace

MonocularMotion::MonocularMotion(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options)
    : MotionSource(camera, bMc, options.points),
      m_camera(camera),
      m_bMc(bMc),
      m_camera_height(options.camera_height),
      m_focal_sigma(options.focal_sigma),
      m_model(options.motion, options.points.gyro),
      m_odometry(camera, options.focal_sigma),
      m_monitor(bMc)
{
}

int MonocularMotion::iterations(int asked) const { return std::min(asked, kMostIterations); }

PosePrior MonocularMotion::first(const Frame &frame)
{
  PosePrior prior;
  constexpr double kGuessed = 0.15; // of an image taken to be upright [rad]
  constexpr double kSeen = 0.06;    // of one whose trunks were seen [rad]
  double tilt = kGuessed;
  m_points.track(frame);
  if (frame.status == FrameStatus::ok) {
    placeFrame(frame, std::nullopt);
    if (m_first_up) {
      prior.mean.R = levelled(Matrix3d::Identity(), m_bMc.R * *m_first_up);
      tilt = kSeen;
    }
  }
  m_model.advance(frame);
  prior.covariance.setZero();
  prior.covariance.diagonal() << 1e-6, 1e-6, 1e-6, tilt * tilt, tilt * tilt, 1e-6;
  return prior;
}

/// Places the frame by its points and measures the direction of gravity and the height over the ground in it.
PointOdometryResult MonocularMotion::placeFrame(const Frame &frame, const std::optional<GyroRotation> &rotated)
{
  const PointOdometryResult placed = m_odometry.process(m_points.tracker(), rotated);
  m_pointsMc = placed.wMc;
  m_placed.push_back(m_frame);
  const VerticalEstimate vertical = m_verticals.find(frame.image, m_camera, placed.wMc.R, up());
  m_vertical.add(placed.wMc.R, vertical);
  m_frames_with_up += vertical.known;
  if (vertical.isSure())
    m_first_up = vertical.up;
  if (!m_has_unit && placed.status == PointOdometryStatus::ok)
    chooseUnit();
  measureHeight();
  return placed;
}

/// The direction of up in the camera of the frame placed last.
std::optional<Vector3d> MonocularMotion::up() const
{
  if (!m_vertical.known())
    return std::nullopt;
  return Vector3d(m_pointsMc.R.transpose() * m_vertical.up());
}

double MonocularMotion::upSigma() const { return std::sqrt(0.5 * m_vertical.covariance().trace()); }

/// The first guess of the scale: by the height over the ground, or else by the usual depth of a forest.
void MonocularMotion::chooseUnit()
{
  m_has_unit = true;
  const std::vector<PointDepth> depths = m_odometry.depths();
  const GroundHeight ground = up() ? heightOverGround(depths, m_camera, *up()) : GroundHeight();
  if (ground.known) {
    m_unit = (isHeightKnown() ? m_camera_height : kStartHeight) / ground.height;
    return;
  }
  std::vector<double> inverse;
  for (const PointDepth &point : depths)
    if (point.inverse_depth > 3 * point.sigma)
      inverse.push_back(point.inverse_depth);
  m_unit = inverse.empty() ? 1 : kStartDepth * medianOf(inverse);
}

void MonocularMotion::measureHeight()
{
  m_height_seen.reset();
  if (!m_has_unit || !up())
    return;
  const GroundHeight ground = heightOverGround(m_odometry.depths(), m_camera, *up());
  if (!ground.known)
    return;
  m_height_seen = ground.height * m_unit;
  const double height = isHeightKnown() ? m_camera_height : kStartHeight;
  m_height_scale.add(ground, height, kCameraHeightSigma * height);
}

/// The ground under the camera, smoothed: bumps and slopes of some metres stay.
void MonocularMotion::updateGround(const Pose &wMb)
{
  constexpr double kMemory = 0.9;
  if (!m_height_seen)
    return;
  const double seen = (wMb * m_bMc).t.z() - *m_height_seen;
  m_ground_z = m_ground_z ? kMemory * *m_ground_z + (1 - kMemory) * seen : seen;
}

ScaleEstimate MonocularMotion::scale() const
{
  const ScaleSource source = isHeightKnown() ? ScaleSource::height : ScaleSource::prior;
  if (!m_height_scale.known())
    return {0, kStartSigma, source};
  const double sigma = isHeightKnown() ? kCameraHeightSigma : kStartSigma;
  return {std::log(m_height_scale.metresPerUnit() / m_unit), std::hypot(m_height_scale.relativeSigma(), sigma), source};
}

WorldReference MonocularMotion::reference() const
{
  WorldReference reference;
  reference.gravity = m_vertical.known() ? GravitySource::trunks : GravitySource::assumed;
  reference.gravity_sigma = m_vertical.known() ? upSigma() : 0;
  reference.has_ranges = m_has_unit;
  return reference;
}

/// A motion of the camera in units of m_odometry as one of the body. \p is_held: the translation was not seen.
Odometry MonocularMotion::toBody(const Pose &caMcb, Matrix6d covariance, bool is_held) const
{
  covariance.topRows<3>() *= m_unit;
  covariance.leftCols<3>() *= m_unit;
  const double along = kStepScaleSigma * m_unit * caMcb.t.norm();
  const double least = is_held ? kStillSigma : kStepSigma;
  if (is_held) {
    covariance.topRows<3>().setZero();
    covariance.leftCols<3>().setZero();
  }
  covariance.topLeftCorner<3, 3>() += (least * least + along * along) * Matrix3d::Identity();
  const double by_focal = m_focal_sigma * logSo3(caMcb.R).norm(); // a rotation is wrong by as much of itself
  const double rotation_variance = kTurnSigma * kTurnSigma + by_focal * by_focal;
  covariance.bottomRightCorner<3, 3>() += rotation_variance * Matrix3d::Identity();
  const Matrix6d to_body = adjoint(m_bMc);
  return {m_bMc * Pose(caMcb.R, m_unit * caMcb.t) * m_bMc.inverse(), to_body * covariance * to_body.transpose()};
}

/// Adds the motion between the frames before the first baseline, which can be placed now.
void MonocularMotion::addEarlierFrames(Motion &motion) const
{
  const std::vector<PlacedFrame> path = m_odometry.trajectory();
  const std::size_t newest = path.size() - 1; // its motion comes as the step
  const auto add = [&](std::size_t a, std::size_t b) {
    const Odometry odometry = toBody(path[a].wMc.inverse() * path[b].wMc, Matrix6d::Zero(), false);
    motion.odometry.push_back({m_placed[a], m_placed[b], odometry});
  };
  std::size_t last = 0;
  while (last < newest && path[last + 1].status != PointOdometryStatus::ok)
    ++last;
  for (std::size_t i = last + 1; i < newest; ++i)
    if (path[i].status == PointOdometryStatus::ok) {
      add(last, i);
      last = i;
    }
  if (last + 1 < newest) // frames in between were not placed
    add(last, newest);
}

/// Verdicts on the gyro, and on an odometry that is not used because the first frame does not have it.
std::vector<SensorVerdict> MonocularMotion::verdicts() const
{
  std::vector<SensorVerdict> verdicts = m_monitor.verdicts();
  if (m_odometry_from_s)
    verdicts.push_back(
        {toString(Sensor::odometry), "time", *m_odometry_from_s,
         fmt::format("odometry: begins at {:.1f} s, after the images, and is not used", *m_odometry_from_s)});
  return verdicts;
}

MotionStep MonocularMotion::predictStep(const Frame &frame, const Pose &wMa, const Vector6d &velocity)
{
  const MotionStep step = m_model.step(frame, wMa, m_points.gyroBias(), velocity);
  m_model.advance(frame);
  return step;
}

/// Compares the gyro with the rotations of the points.
void MonocularMotion::compareGyro(const Frame &frame)
{
  Frame images = frame, scratch;
  images.wMb_odometry.reset(); // one that begins late is not used
  m_monitor.process(images, m_points.process(m_monitor.withoutRejectedSensors(images, scratch)));
}

Motion MonocularMotion::step(const Frame &frame, const Pose &wMa, const Vector6d &velocity)
{
  Motion motion;
  ++m_frame;
  if (frame.wMb_odometry && !m_odometry_from_s)
    m_odometry_from_s = secondsOf(frame.stamp_ns);
  motion.is_rotation_seen = true;
  Frame scratch;
  if (frame.gyro.empty())
    m_points.track(frame);
  else
    compareGyro(frame);
  motion.step = predictStep(m_monitor.trusted(frame, scratch), wMa, velocity);
  motion.step.is_step_measured = false;
  motion.image_fault = m_points.fault();
  if (frame.status == FrameStatus::ok && motion.image_fault.empty())
    useImageMotion(frame, wMa, motion);
  return motion;
}

/// Replaces the predicted step by the motion that the image of \p frame measures.
void MonocularMotion::useImageMotion(const Frame &frame, const Pose &wMa, Motion &motion)
{
  const bool is_next = !m_placed.empty() && m_placed.back() + 1 == m_frame;
  std::optional<GyroRotation> rotated; // of the camera
  if (motion.step.turn_from_gyro && is_next) {
    rotated.emplace();
    rotated->R = m_bMc.R.transpose() * motion.step.aMb.R * m_bMc.R;
    rotated->white = m_bMc.R.transpose() * motion.step.covariance.bottomRightCorner<3, 3>() * m_bMc.R;
    rotated->complete = true;
  }
  const bool is_first = m_placed.empty(), had_unit = m_has_unit;
  const Pose before = m_pointsMc;
  const std::size_t last_placed = is_first ? m_frame : m_placed.back();
  const PointOdometryResult placed = placeFrame(frame, rotated);
  motion.has_new_unit = m_has_unit && !had_unit;
  if (is_first)
    return;
  Pose caMcb = before.inverse() * placed.wMc;
  Matrix6d covariance = placed.covariance;
  if (motion.has_new_unit) {
    const std::vector<PlacedFrame> path = m_odometry.trajectory();
    caMcb = path[path.size() - 2].wMc.inverse() * path.back().wMc;
    covariance.setZero(); // of the whole way from the start: between two frames of one solution little is left
    addEarlierFrames(motion);
  }
  const Odometry odometry = toBody(caMcb, covariance, !m_has_unit);
  if (is_next) {
    motion.step.aMb = odometry.aMb;
    motion.step.covariance = odometry.covariance;
  }
  else
    motion.odometry.push_back({last_placed, m_frame, odometry});
  motion.step.is_step_measured = m_has_unit && placed.status == PointOdometryStatus::ok;
  if (up()) { // frames share the lean of their trunks: the sum over frames must not know more than the filter
    const Matrix3d bRw = m_bMc.R * m_pointsMc.R.transpose();
    const Matrix32d basis = bRw * directionBasis(m_vertical.up());
    const Matrix3d of_up = std::min(30, m_frames_with_up) * basis * m_vertical.covariance() * basis.transpose();
    motion.step.absolute = tiltPrior(wMa * motion.step.aMb, m_bMc.R * *up(), of_up);
  }
  updateGround(wMa * motion.step.aMb);
}
} // namespace bole
