// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// All borders of all trunks vote on how far the camera is from where it was expected.
///
/// Idea: one border's strongest edge is the right one only in about half of the views of a textured forest, so no
/// border may decide alone. But all borders move with the same six numbers, and their profiles tell the energy at every
/// offset. So the joint energy of a pose is one look-up a border, and thousands of poses under the predicted covariance
/// are tried on a grid over the three directions in which the prediction leaves the borders most uncertain.

#include <bole/pose.h>

#include <vector>

namespace bole
{
struct BallotBorder
{
  /// Offset of the border in the image [px] per twist of the camera.
  Eigen::Matrix<double, 1, 6> offset_by_twist = Eigen::Matrix<double, 1, 6>::Zero();
  std::vector<float> response; ///< 0 .. 1 at offsets -half .. half, step 1 px
};

struct Vote
{
  Vector6d twist = Vector6d::Zero(); ///< from the prediction to the best pose
  double score = 0;                  ///< sum of the responses there over the number of borders, 0 .. 1
};

/// The twist with the greatest log-likelihood: that of the responses less half its squared deviation under \p
/// covariance.
Vote vote(const std::vector<BallotBorder> &borders, const Matrix6d &covariance);
} // namespace bole
