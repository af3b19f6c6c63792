// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// All borders of all trunks vote on how far the camera is from where it was expected.
///
/// Idea: one border's strongest edge is the right one only in about half of the views of a textured
/// forest, so no border may decide alone. But all borders move with the same six numbers. Their profiles, once
/// sampled, tell the energy at every offset; so the joint energy of a pose is one look-up a border, and
/// thousands of poses under the predicted covariance can be tried, on a grid over the three directions in which the
/// prediction leaves the borders most uncertain. The best one picks the maxima that the servoing then follows.
///
/// Cost: at most Options::max_poses look-ups a border, about 0.1 ms for ten trunks.

#include <bole/pose.h>

#include <vector>

namespace bole
{
struct BallotBorder
{
  /// Offset of the border in pixels, along its outward normal, per twist of the camera.
  Eigen::Matrix<double, 1, 6> offset_by_twist = Eigen::Matrix<double, 1, 6>::Zero();
  std::vector<float> response; ///< 0 .. 1 at offsets -half .. half, step 1 px
};

struct VoteOptions
{
  double weight = 2;    ///< log-likelihood of a full response against none (0.1 .. 20)
  double step_px = 1.5; ///< of the grid, at the border that moves most (0.5 .. 5)
  double sigmas = 3;    ///< half-width of the grid (1 .. 5)
  int max_poses = 6000; ///< limit of the grid (100 .. 1e6)
};

struct Vote
{
  Vector6d twist = Vector6d::Zero(); ///< from the prediction to the best pose
  double score = 0;                  ///< sum of the responses there over the number of borders, 0 .. 1
};

/// The twist with the greatest weight * sum of responses - half its squared deviation under \p covariance.
Vote vote(const std::vector<BallotBorder> &borders, const Matrix6d &covariance, const VoteOptions &options);
} // namespace bole
