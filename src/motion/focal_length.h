// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The focal length of a video that came without a camera file, from the points that the camera sees.
///
/// Idea: a rigid world is explained well by a moving camera only under its own focal length. The video goes through the
/// point odometry under a grid of focal lengths; each frame tells how many points each explains and how closely, and
/// the one that explains best over all frames wins; a bundle adjustment of key frames of the whole video with the focal
/// length among its unknowns makes it exact. Where the camera only turns, nothing is needed but a rotation between two
/// frames: under a wrong focal length it leaves the points at the border of the image behind.
///
/// Laws (each a test): a camera that turns tells its focal length from a guess that is off by a factor of two, one that
/// flies a curve from a guess that is off by a third; one that flies straight on without turning says that it cannot.
///
/// Cost: 30 ms a frame beside the tracker, and a second at the end. Not thread-safe.

#include "motion/point_odometry.h"

#include <vector>

namespace bole
{
/// Standard deviation of the log of a focal length of which nothing is known: 50 to 81 degrees about the 65 that are
/// taken.
constexpr double kGuessedFocalSigma = 0.3;

struct FocalEstimate
{
  bool known = false;
  double factor = 1; ///< of the guess
  double sigma = 0;  ///< relative
};

class FocalFinder
{
public:
  /// \p guess: of the camera, no longer than 2.2 times the true one and no shorter than 0.3 times.
  explicit FocalFinder(const PinholeCamera &guess);

  /// Takes in the current frame of \p tracker.
  void add(const PointTracker &tracker);
  FocalEstimate estimate() const;

private:
  using Costs = std::vector<std::vector<double>>; ///< by frame and focal length

  void addTurn(const PointTracker &tracker);
  FocalEstimate adjusted(double log_factor) const;

  PinholeCamera m_guess;
  std::vector<PointOdometry> m_odometry; ///< one a focal length
  Costs m_flown, m_turned;
  std::vector<std::vector<std::pair<std::uint64_t, Eigen::Vector2d>>> m_seen; ///< by frame: tracks, under the guess
  int m_moved = 0; ///< frames with flow enough to see whether they turned
};
} // namespace bole
