// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far the whole picture moved between two frames: a start for windows where the camera turned farther than they
/// can be followed.
///
/// Idea: both pictures are made 40 pixels wide and correlated at all shifts that leave a quarter of them in common. Of
/// n pixels with a correlation rho a shift explains -n/2 log(1 - rho^2) of the likelihood; the greatest one counts, so
/// a small part that looks alike by chance does not win.
///
/// Cost: 4 million operations, so it is asked where following failed only.

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace bole
{
/// [px]: what was at p in \p first is about p + shift in \p second, to a fortieth of the width; zero where nothing
/// correlates.
Eigen::Vector2d coarseShift(const cv::Mat &first, const cv::Mat &second);
} // namespace bole
