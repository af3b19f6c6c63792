// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The path of a camera from points alone, in a unit that nobody knows but that stays the same:
/// what a plain video has in place of a pose filter.
///
/// Idea: the first two frames with enough parallax between them set the unit of length (their
/// distance). Points get an inverse depth, kept with its uncertainty; every frame is placed against
/// them, together with the last few key frames and all inverse depths, by a robust bundle
/// adjustment over a sliding window (inverse depths eliminated). The oldest key frames of the
/// window are held, which hands the unit on.
///
/// Frames: `wMc`, w = the camera of the first frame (camera axes!), lengths in units of the first
/// baseline. A gyro, where there is one, enters as a prior on the rotations.
/// A camera that only turns gets its rotation and the status rotation_only: the translation is then
/// held at its place, with a covariance that says so, not guessed.
///
/// Cost: about 1.3 ms a frame with 150 points (benchmark_motion). Not thread-safe.

#include "motion/gyro.h"
#include "motion/point_tracker.h"
#include "motion/relative_pose.h"
#include <bole/pose.h>

#include <memory>
#include <vector>

namespace bole
{
enum class PointOdometryStatus
{
  starting, ///< no baseline yet: rotation only, no unit of length
  ok,
  rotation_only, ///< too few points of known depth: the translation is held
  lost           ///< not enough points: nothing but the prediction
};

/// Inverse depth of a point in the current image.
struct PointDepth
{
  Eigen::Vector2d pixel;
  double inverse_depth = 0; ///< along z of the camera [1/unit]
  double sigma = 0;         ///< [1/unit]
  std::uint64_t id = 0;
};

struct PointOdometryResult
{
  PointOdometryStatus status = PointOdometryStatus::starting;
  Pose wMc;
  /// Of the motion since the frame before, tangent (rho [unit], phi [rad]).
  Matrix6d covariance = Matrix6d::Identity();
  int points = 0;      ///< of known depth in this frame
  double sigma_px = 0; ///< noise of the observations
};

/// Where a frame was, after all that was learnt later.
struct PlacedFrame
{
  Pose wMc;
  PointOdometryStatus status = PointOdometryStatus::starting;
};

class PointOdometry
{
public:
  /// \p focal_sigma: of the log of the focal length, 0 where it is calibrated. Under a wrong one a pan past a wall
  /// looks like a sideways flight, so a start also needs flow that no rotation explains under any within three sigmas.
  explicit PointOdometry(const PinholeCamera &camera, double focal_sigma = 0);
  ~PointOdometry();
  PointOdometry(PointOdometry &&) noexcept;
  PointOdometry &operator=(PointOdometry &&) noexcept;

  /// Places the current frame of \p tracker. \p turned: rotation of the *camera* since the frame
  /// before (gyro), where there is one.
  PointOdometryResult process(const PointTracker &tracker, const std::optional<GyroRotation> &turned = std::nullopt);

  /// All frames so far; those before the start are placed once the first baseline is known.
  std::vector<PlacedFrame> trajectory() const;
  /// Points of the current frame whose inverse depth is known to better than 30 % (or, being far, indistinguishable
  /// from zero).
  std::vector<PointDepth> depths() const;

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
