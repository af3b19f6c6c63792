// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// New trunks from the profiles of the last frames.
///
/// Idea: in one frame any two vertical lines could be the borders of a trunk, and near trunks are not the strongest
/// lines. But a pair that is one trunk has *one* range at which both of its borders stay under the predicted
/// silhouette in every frame of a window, and it is near; pairs of different trunks, of far trunks and of leaves have
/// none. So for each plausible pair of peaks of the current frame the range is swept, the profiles of the window are
/// looked up where the hypothesis puts its borders, the best range is refined by least squares on the nearest peaks,
/// and the fit must say: enough views, enough parallax, small residuals (paper, Section 6, with the threshold on
/// strength of Eq. 18-20 replaced by agreement over frames; Eq. 21 put right: known trunks inhibit).

#include "detection/level_profile.h"
#include "geometry/log_normal.h"
#include <bole/trunk.h>

#include <cmath>
#include <vector>

namespace bole
{
struct DetectorOptions
{
  ProfileOptions profile;
  int window = 18;          ///< frames looked at together, 4 to 100
  double range_min = 1.5;   ///< nearest trunk [m], 0.3 to 5
  double range_max = 10.5;  ///< farthest trunk that matters for planning [m], 2 to 50
  double radius_min = 0.02; ///< [m]
  double radius_max = 0.6;  ///< [m]
  /// [m] What radii to expect: median 0.15 m, within a factor of 2.4 for two in three.
  LogNormal radii{std::log(0.15), 0.74};
  double agreement_min = 0.65;   ///< mean agreement of the borders with the window, 0 to 1
  double inliers_min = 0.7;      ///< part of the views within inlier_px of both borders, 0 to 1
  double inlier_px = 2.5;        ///< [px]
  double rms_max_px = 0.85;      ///< of the inliers, [px]
  double parallax_min = 0.03;    ///< change of the bearing of a border over the window, [rad]
  double range_sigma_max = 0.15; ///< of the fitted range, relative
  double foreground_min = 0.2;   ///< mean of 1 - p(background) along a line beside a border, 0 to 1; .3 before looking
};

/// One frame of the window: its profile and its pose as it is known now.
struct DetectorView
{
  const LevelProfile *profile = nullptr;
  Pose wMc;
};

/// A detected trunk.
struct Detection
{
  Trunk trunk; ///< leans across the line of sight as the lines of the profile do
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity(); ///< of (x, y, log r), given the poses
  double range = 0;                                         ///< from the current camera [m]
  double agreement = 0;                                     ///< 0 to 1
  double rms_px = 0;
  double quality = 0; ///< higher for the better of two hypotheses for the same lines
  int views = 0, inliers = 0;
  double q_left = 0, q_right = 0;               ///< in the current profile
  double left_contrast = 0, right_contrast = 0; ///< signed
};

/// Part of the current profile taken by a known trunk.
struct InhibitedRange
{
  double q_right = 0, q_left = 0;
};

/// Trunks seen in views.back() (the current frame) and agreed on by the others, best first, with every hypothesis for
/// the same lines. \p p_background: of the current frame: trunks are sought where it is salient alone; nullptr:
/// everywhere. Cost: 3 to 6 ms at 320x240 with a window of 18. Thread-safe.
std::vector<Detection> detectTrunks(const std::vector<DetectorView> &views, const PinholeCamera &camera,
                                    const std::vector<InhibitedRange> &known, const vpImage<float> *p_background,
                                    const DetectorOptions &options);

/// Non-maximum suppression: keeps the first of those that overlap in the current frame, since at most one hypothesis
/// for the same lines is a trunk. \p found: best first.
std::vector<Detection> suppressNonMaxima(const std::vector<Detection> &found);
} // namespace bole
