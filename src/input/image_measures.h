// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What is counted in an image to judge its health. Private to ImageHealth.

#include <opencv2/core.hpp>
#include <vector>

namespace bole
{
constexpr double kSearchShare = 0.15; ///< of the width: how far two frames are searched for each other

struct ImageNumbers
{
  double deviation = 0;    ///< of the grey levels
  double roughness = 0;    ///< mean difference of neighbours over the deviation
  double repeated = 0;     ///< share of the rows or columns that repeat their neighbour
  double noise = 0;        ///< standard deviation of what looks like noise [grey levels]
  double sharpness = 0;    ///< mean curvature over two pixels, over the deviation
  double bright_share = 0; ///< share of the pixels at the upper end
  int level_99 = 255;      ///< 99 % of the pixels are at or below
};
/// One pass over every fourth column.
ImageNumbers measureImage(const cv::Mat &image);

/// A small copy in floating point, 80 px wide: a trunk is still a column of it.
cv::Mat thumbOf(const cv::Mat &image);

struct ImageMatch
{
  double correlation = -1;
  double x = 0, y = 0;  ///< shift s [px of the thumb] at which now(u) = before(u + s)
  cv::Mat correlations; ///< of every shift that was tried
  cv::Point zero;       ///< of no shift, in `correlations`

  /// The best correlation within two pixels of a shift; -1 where none was tried.
  double bestNear(double at_x, double at_y) const;
};
ImageMatch matchImages(const cv::Mat &before, const cv::Mat &now);
/// The same of a third of the width each, from left to right: what is near moves otherwise than what is far.
std::vector<ImageMatch> matchStrips(const cv::Mat &before, const cv::Mat &now);

/// Standard deviation of the difference: an exposure that changes is no motion.
double changeBetween(const cv::Mat &a, const cv::Mat &b);
} // namespace bole
