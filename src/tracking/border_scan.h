// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Scan of the border of a trunk sideways under its prediction: the maxima from which the minimisation may start.
///
/// Idea: in a textured forest the basin of the energy is 1-2 px and blur does not widen it, so the profile of the
/// mean gradient is scanned over the prediction's uncertainty and the pair of maxima (left, right) is chosen that
/// best fits strength, prediction and the signed contrast that the border had in the frames before.

#include "tracking/border_profile.h"

namespace bole
{
/// Local maxima of abs(mean gradient) with the line moved by up to +-\p half_width_px, strongest first, at most
/// \p most. The profile has a step of half a pixel, full scale a pixel; peaks are refined by a parabola.
std::vector<BorderPeak> scanBorder(const vpImage<float> &g, const BorderLine &line, double half_width_px,
                                   double contrast_min, std::size_t most = 6);

struct PairPrior
{
  Eigen::Matrix2d covariance_px = Eigen::Matrix2d::Identity(); ///< of (left, right) offsets under the prediction
  std::optional<double> left_contrast, right_contrast;         ///< signed, from the frames before
};
struct PeakPair
{
  BorderPeak left, right;
  double cost = 0; ///< negative log-likelihood up to a constant
};
/// The best (left, right) pairs, lowest cost first, at most \p most. With an empty side the other stands alone.
std::vector<PeakPair> pairPeaks(const std::vector<BorderPeak> &left, const std::vector<BorderPeak> &right,
                                const PairPrior &prior, std::size_t most = 3);
} // namespace bole
