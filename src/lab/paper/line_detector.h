// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Section 6 of the paper, Eq. 18 to 21: new trees from one frame.
///
/// Each vertical line is the left (right) border of a new salient tree with the probability that the negative
/// (positive) part of the gradient along it is strong enough, that it lies on foreground, and that no known tree
/// inhibits it; maxima above a threshold are paired, from the most probable on.
///
/// Slips of the print put right: Q rises with x for a < 0 and takes the magnitude of the gradient (Eq. 19);
/// p(non_inhib) = 1 - min(1, sum exp(-d^2 / (2 sigma_R^2))) (Eq. 21).
///
/// Law (a test): the probabilities are the product of the three, each by brute force.

#include "paper/tree_energy.h"
#include <bole/pose.h>

#include <vector>

namespace bole::paper
{
constexpr double kThreshold = 0.75; ///< "a fixed threshold"

/// Upper quartiles over all lines of all pictures of a flight, as `bole reproduce --statistics` prints them.
struct LineQuartiles
{
  double gradient = 0.042;   ///< of the mean of the blurred part (Eq. 19) [full scale/px]; data/park-forward's
  double foreground = 0.574; ///< of the mean of 1 - p(background) (Eq. 20)
};

/// Q of Eq. 19 and 20, its parameters "by inspection of the statistics of the data": one half at the quartile, nine
/// tenths at 1.2 times of it.
double probabilityOf(double value, double quartile);

/// The mean of an image along every vertical line through the camera: the camera turned level, a line is a column
/// q = tan(bearing from the heading), positive to the left.
struct LevelProfile
{
  Eigen::Matrix3d cRl = Eigen::Matrix3d::Identity(); ///< level frame (forward, left, up) to camera
  double step = 0.0025, q_first = 0;                 ///< q of sample i: q_first + step * i
  std::vector<double> mean;                          ///< 0 where most of the line is not in the image

  LevelProfile(const vpImage<float> &image, const PinholeCamera &camera, const Eigen::Matrix3d &wRc);
};

/// Columns of the level frame that a tree takes.
struct TakenRange
{
  double q_low = 0, q_high = 0;
};

struct NewTree
{
  RelativeTrunk relative;
  double p_left = 0, p_right = 0;
};

/// \p p_background: of each pixel; \p wRc: attitude of the camera; \p known: where the trees stand that are looked for.
std::vector<NewTree> detectTrees(const SplitGradient &gradient, const vpImage<float> &p_background,
                                 const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                                 const std::vector<TakenRange> &known, const LineQuartiles &quartiles);

/// sigma_R of Eq. 21 [px]: 6 px for a focal length of 200 px.
double inhibition_px(const PinholeCamera &camera);
} // namespace bole::paper
