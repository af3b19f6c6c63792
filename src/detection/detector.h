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
#include "geometry/log_normal.h"
#include "gradient/border_line.h"
#include <bole/pose.h>
#include <bole/trunk.h>

#include <cmath>
#include <optional>
#include <vector>

namespace bole
{
// One frame reduced to the mean gradient along a vertical line at each bearing.
//
// Idea: turn the camera level. Every vertical plane through the camera centre is then a column q = tan(bearing),
// and the mean signed gradient along its part that any trunk within range must fill is one number. A frame is a
// 1-D profile; its local maxima are where a border of a trunk may be, either polarity.

/// Local maximum of abs(profile).
struct ProfilePeak
{
  double q = 0;        ///< tan of the bearing from the heading, positive to the left
  double contrast = 0; ///< signed mean gradient [full scale/px]
};

struct LevelProfile
{
  Eigen::Matrix3d cRl = Eigen::Matrix3d::Identity(); ///< level frame (forward, left, up) to camera
  double step = 0.0025;                              ///< in q between samples
  double q_first = 0;                                ///< q of sample 0; samples run to the left
  double lean = 0;                                   ///< of the lines: q is where they cross the camera's height
  std::vector<float> mean;                           ///< signed mean gradient; 0 where the line is not in the image
  std::vector<float> rising;                         ///< largest mean within a pixel: the best dark-bright border, >= 0
  std::vector<float> falling;      ///< smallest mean within a pixel: the best bright-dark border, <= 0
  std::vector<ProfilePeak> peaks;  ///< by rising q
  std::vector<float> rising_peak;  ///< q of the dark-bright peak nearest to each sample; NaN where there is none
  std::vector<float> falling_peak; ///< q of the bright-dark one

  double qLast() const { return q_first + step * static_cast<double>(mean.size() - 1); }
  bool covers(double q) const { return q >= q_first && q <= qLast(); }
};

struct ProfileOptions
{
  ElevationRange range;        ///< of the lines, tan of elevation
  double lean = 0;             ///< of the lines across the line of sight, positive to the left [tan], -0.5 to 0.5
  double contrast_min = 0.008; ///< weaker maxima are no peaks [full scale/px], 0.001 to 0.5
};

/// Mean of \p image along the line at \p q of \p profile, over the elevations \p range; nothing where too little of it
/// is in the image.
std::optional<double> meanAlong(const vpImage<float> &image, const PinholeCamera &camera, const LevelProfile &profile,
                                double q, const ElevationRange &range);

/// Profile of the gradient \p g seen by \p camera with the rotation \p wRc. Cost: about 0.5 ms at 320x240.
LevelProfile computeLevelProfile(const vpImage<float> &g, const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                                 const ProfileOptions &options);

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
