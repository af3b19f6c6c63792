// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where small windows of one image are in the next: pyramidal Lucas-Kanade.
///
/// The method, its pyramid and its limits are those of cv::calcOpticalFlowPyrLK (J.-Y. Bouguet, Pyramidal
/// implementation of the Lucas Kanade feature tracker), a row of the window at a time: a third of the
/// instructions, and the same to the rounding of sums.

#include <opencv2/core.hpp>
#include <vector>

namespace bole
{
/// The image and its halves, each a little larger than it is by reflection.
using GreyPyramid = std::vector<cv::Mat>;
void buildPyramid(const cv::Mat &image, int levels, GreyPyramid &pyramid);

/// Least over greatest eigenvalue of the gradient moments of the window round \p at: 1 where the picture changes alike
/// in all directions, 0 along a line, on which a window can slide. A position errs along the weak direction by 1 /
/// sqrt(roundness) of its error across it.
double roundness(const cv::Mat &image, const cv::Point2f &at);
/// A window below it has no place of its own: measured on five flights with known poses, the residuals follow the
/// law above, and below 0.1 every second one is beyond a pixel where ropes and beams are in view.
constexpr double kLeastRoundness = 0.1;

/// Finds the window round \p from of \p first in \p second, from \p to on, on so many \p levels above the image; false
/// where it has no texture or leaves the image. A point is taken to be as bright in both.
bool followWindow(const GreyPyramid &first, const GreyPyramid &second, const cv::Point2f &from, cv::Point2f &to,
                  int levels);
} // namespace bole
