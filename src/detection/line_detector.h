// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// New trunks from one frame: the paper's detector (Section 6, Eq. 18-21).
///
/// Idea: each vertical line is the left (right) border of a new salient trunk with the probability that its gradient
/// is strong enough, that it lies on foreground, and that no known trunk inhibits it; maxima above a threshold are
/// paired. It needs no translation, so it is also what finds trunks in a plain video. Its ranges are those of the
/// prior on the radius.
///
/// Deviations: two borders are neighbours (no stronger line stands between them) and belong to one trunk only. Printed
/// formulas put right: Q rises with x for a < 0 and takes the magnitude of the gradient (Eq. 19); p(non_inhib) = 1 -
/// min(1, sum exp(-d^2 / (2 sigma_R^2))) (Eq. 21).

#include "detection/detector.h"
#include "gradient/gradient.h"

namespace bole
{
struct LineDetectorOptions
{
  bool either_polarity = true;                 ///< false: dark trunks on bright background only
  double border_a = -200, border_b = 4;        ///< of Q for the mean gradient along a border (Eq. 19)
  double foreground_a = -12, foreground_b = 3; ///< of Q for the mean of 1 - p(background) along it (Eq. 20)
  double inhibition_px = 6;                    ///< sigma_R of Eq. 21, 0.5 to 100
  double threshold = 0.75;                     ///< on the probability of each border, 0 to 1; the paper's value
  double turning_threshold = 0.12; ///< the same for a camera that only turns: a pan blurs, and there is no saliency to
                                   ///< keep out what is not near, only how evenly borders run (MapOptions)
  double width_min_px = 6;         ///< of a trunk in the image, 2 to 1000
  double width_max_px = 90;        ///< 3 to 5000
};

struct LineDetection
{
  RelativeTrunk relative;
  double p_left = 0, p_right = 0;
};

/// \p p_background: of each pixel, or nullptr when every line may be foreground; \p wRc: attitude of the camera; \p
/// known: columns of the level frame that known trunks take. Thread-safe.
std::vector<LineDetection> detectLines(const Gradient &gradient, const vpImage<float> *p_background,
                                       const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                                       const std::vector<InhibitedRange> &known, const ProfileOptions &profile,
                                       const LineDetectorOptions &options);
} // namespace bole
