// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One frame reduced to the mean gradient along a vertical line at each bearing.
///
/// Idea: turn the camera level. Every vertical plane through the camera centre is then a column q = tan(bearing),
/// and the mean signed gradient along its part that any trunk within range must fill is one number. A frame is a
/// 1-D profile; its local maxima are where a border of a trunk may be, either polarity.

#include "gradient/border_line.h"
#include <bole/pose.h>

#include <optional>
#include <vector>

namespace bole
{
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
} // namespace bole
