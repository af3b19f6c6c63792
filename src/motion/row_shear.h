// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The shear of one image against another, as a rolling shutter makes: rows that were read out later stand farther to
/// the side.
///
/// Idea: a static point seen from two places keeps to its epipolar line whatever its depth (relative_pose.h). A camera
/// that turns while it is read out moves a row by an amount that grows with its number, and so takes points off their
/// lines where those are not parallel to the rows. The amount is one more unknown beside rotation and direction: it
/// is known as well as the directions of the lines allow, and not at all of a flight sideways, whose lines are the
/// rows. A vertical shear is not asked for: it moves no upright trunk, and it looks like a flight ahead.
///
/// Frames: as relative_pose.h; in b a point stands at x + shear * y instead of x (camera axes, over the depth).
///
/// Laws (each a test): a shear put into matches comes back within three standard deviations; a pure rotation, a roll
/// and points at any depth make none; of a flight sideways its sigma says that it is unknown.
///
/// Cost: about 0.1 ms for 150 matches. Not thread-safe.

#include "motion/relative_pose.h"
#include <bole/pose.h>

namespace bole
{
struct RowShear
{
  double shear = 0; ///< of b against a: sideways over upwards, tangent of the lean that it gives an upright trunk
  double sigma = 1; ///< 1 where nothing is known
  Pose aMb;         ///< motion beside it; the translation is a unit vector
  double noise = 0; ///< of the residuals of the bulk [normalised]
};

/// \p prior: rotation and translation as gyro and pose filter say, where they do; \p starts: motions (aRb, direction)
/// to begin with, of which the one that explains most wins. Sheared matches lead estimateRelativePose() far astray.
RowShear estimateRowShear(const std::vector<PointMatch> &matches, const PinholeCamera &camera,
                          const RelativePosePrior &prior, const std::vector<Pose> &starts,
                          double min_sigma_px = kMatchSigma_px);

/// Chi-squared (one degree of freedom where nothing is sheared) by which \p row explains the matches better than the
/// best motion without a shear that is found from \p starts and its own: the ratio of likelihoods holds where the sigma
/// of a linear fit does not, as in a flight sideways above the ground, of which another direction explains as much.
double gainOfShear(const RowShear &row, const std::vector<PointMatch> &matches, const PinholeCamera &camera,
                   const RelativePosePrior &prior, const std::vector<Pose> &starts,
                   double min_sigma_px = kMatchSigma_px);
} // namespace bole
