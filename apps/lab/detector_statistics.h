// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the paper's detector reads along the lines of a flight (Eq. 19 and 20): its thresholds are set "by inspection
/// of the statistics of the data" (Section 6). And how far its energy (Eq. 3) has its minima from true trunks: alpha is
/// calibrated where those errors are what the curvature says.

#include "input/truth.h"
#include "pipeline/stage_options.h"

#include <string>
#include <vector>

namespace bole::apps
{
/// A true trunk as a camera sees it.
struct TrueView
{
  double ahead = 0; ///< its bearing less the camera's heading [rad]
  double range = 0; ///< [m]
  double half_angle = 0;
};
/// Those whose radius is known, nearer than \p range [m] and \p widest [rad] from the heading of the camera.
std::vector<TrueView> trueViews(const std::vector<TruthTrunk> &trunks, const Pose &wMc, double range, double widest);

/// One value a vertical line of each image: all lines, and those nearest to the borders of true trunks.
struct LineStatistics
{
  std::vector<double> of_all, of_borders;
};

struct DetectorStatistics
{
  LineStatistics gradient;   ///< mean of the blurred part, positive where it speaks for a border [full scale/px]
  LineStatistics foreground; ///< mean of 1 - p(background)
  /// Of the minimum of Eq. 3 with alpha 1 next to each true trunk: squared distance of the relative trunk to the true
  /// one in standard deviations, chi-square distributed with four degrees of freedom times 1 / alpha.
  std::vector<double> squared_errors;
  std::size_t without_minimum = 0; ///< views of true trunks

  LineQuartiles quartiles() const;
  /// At which the median of squared_errors is that of the chi-square distribution; NaN without any.
  double calibratedAlpha() const;
};

/// Reads the flight \p sequence with the preset of the paper. Trunks of the truth count within \p range [m].
DetectorStatistics detectorStatistics(const std::string &sequence, double range = 6);

/// A table of quantiles.
std::string toTable(const DetectorStatistics &statistics);
} // namespace bole::apps
