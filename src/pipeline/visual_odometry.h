// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a plain video says of the motion between two frames, as the smoother wants it: in place of the pose filter.
///
/// Idea: PointOdometry places every frame in a unit of length that stays, the edges of the trunks say which way is up,
/// and ground points say how many units the camera is over the ground. A metre is a number of units that starts as a
/// guess and is corrected from outside (rescale()): by a height that somebody knows or by the radii of the trunks.
///
/// Frames: w level with the first camera at its origin, a the body at the frame before, b the body now.
/// A camera that only turns gets its rotation; its place is held (`still_sigma`) until some parallax says otherwise.
/// What is learnt of earlier frames only later (the first baseline, frames after a gap) comes as links.

#include "motion/ground_plane.h"
#include "motion/point_odometry.h"
#include "motion/vertical.h"
#include "pipeline/motion_model.h"

namespace bole
{
struct VisualOdometryOptions
{
  double camera_height = 0;         ///< of the camera over the ground, where it is known [m]; 0 (unknown) to 100
  double camera_height_sigma = 0.1; ///< of camera_height, in proportion, 1e-3 to 1
  double start_height = 1.5;        ///< taken for the camera's until the trunks say better [m], 0.1 to 100
  double start_depth = 8;         ///< median depth of the points where no ground is seen at the start [m], 0.5 to 1000
  double start_sigma = 0.5;       ///< of the log of the scale that these two give, 0.05 to 5
  double step_sigma = 0.004;      ///< least noise of a step [m], 1e-5 to 1
  double step_scale_sigma = 0.02; ///< error of a step in proportion to its length, 0 to 1
  double turn_sigma = 0.0004;     ///< least noise of a turn [rad], 1e-6 to 1
  double still_sigma = 0.03;      ///< of a step before any parallax was seen [m], 1e-4 to 10
  int max_iterations = 2;         ///< of the smoother a frame, at most: no pose filter holds the path, so what a false
                                  ///< trunk pulls before it is given up is kept short, 1 to 100
  bool focal_known = true;        ///< false: a guess, so a sideways flight needs better proof against a pan

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// The motion between two earlier frames, by Frame::index.
struct VisualLink
{
  std::size_t a_index = 0, b_index = 0;
  Odometry odometry;
};

struct VisualStep
{
  MotionStep step;
  std::vector<VisualLink> links;
  bool has_length = false; ///< the step was seen, in metres as far as these are known
};

class VisualOdometry
{
public:
  VisualOdometry(const PinholeCamera &camera, const Pose &bMc, const VisualOdometryOptions &options = {});

  /// Pose and covariance of the first frame, which \p tracker has just seen (or not, where the frame is not ok).
  PosePrior first(const Frame &frame, const PointTracker &tracker);

  /// The step to \p frame, which \p tracker has just seen. \p predicted: what MotionModel::step() says, for what the
  /// image does not; \p wMa: the pose of the frame before; \p turned: rotation of the camera since the frame before
  /// (gyro), where there is one.
  VisualStep step(const Frame &frame, const PointTracker &tracker, const MotionStep &predicted, const Pose &wMa,
                  const std::optional<GyroRotation> &turned);

  bool hasUnit() const { return m_has_unit; } ///< false while the camera has only turned
  double metresPerUnit() const { return m_metres_per_unit; }
  /// Lengths grow by \p factor from now on.
  void rescale(double factor) { m_metres_per_unit *= factor; }

  /// Height of the camera over the ground in the last frame [m], where the ground was seen.
  std::optional<double> heightSeen() const { return m_height_seen; }
  bool isHeightKnown() const { return m_options.camera_height > 0; }
  /// Log of the scale that the height over the ground gives (camera_height, else start_height; the first guess while no
  /// ground was seen) over that of now, and its standard deviation.
  struct Correction
  {
    double log_scale = 0, sigma = 0;
  };
  Correction fromHeight() const;

  bool knowsUp() const { return m_vertical.known(); }
  double upSigma() const; ///< [rad]

private:
  PointOdometryResult place(const Frame &frame, const PointTracker &tracker, const std::optional<GyroRotation> &turned);
  void chooseUnit();
  void measureHeight();
  Odometry toBody(const Pose &caMcb, Matrix6d covariance, bool is_held) const;
  void linkBacklog(VisualStep &result) const;
  std::optional<Eigen::Vector3d> up() const;

  PinholeCamera m_camera;
  Pose m_bMc;
  VisualOdometryOptions m_options;
  PointOdometry m_points;
  VerticalFilter m_vertical; ///< in the world of m_points
  ScaleFromHeight m_height_scale;
  std::vector<std::size_t> m_indices;        ///< Frame::index of the frames placed
  std::optional<std::size_t> m_last_index;   ///< of the last frame, placed or not
  Pose m_pointsMc;                           ///< the last frame placed, in units
  std::optional<Eigen::Vector3d> m_first_up; ///< up in the last camera while m_vertical is not known
  std::optional<double> m_height_seen;
  double m_metres_per_unit = 1, m_first_metres_per_unit = 1;
  int m_frames_with_up = 0;
  bool m_has_unit = false;
};
} // namespace bole
