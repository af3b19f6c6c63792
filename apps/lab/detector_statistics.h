// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the paper's detector reads along the lines of a flight (Eq. 19 and 20): its thresholds are set "by inspection
/// of the statistics of the data" (Section 6). And how far its energy (Eq. 3) has its minima from true trunks: alpha is
/// calibrated where those errors are what the curvature says.

#include "paper/paper_mapper.h"
#include <bole/open_source.h>

#include <string>
#include <vector>

namespace bole::apps
{
struct DetectorStatistics
{
  // One value a vertical line of each image:
  std::vector<double> gradient;   ///< mean of the blurred part, positive where it speaks for a border [full scale/px]
  std::vector<double> foreground; ///< mean of 1 - p(background)
  /// Of the minimum of Eq. 3 with alpha 1 next to each true trunk: squared distance of the relative trunk to the true
  /// one in standard deviations, chi-square distributed with four degrees of freedom times 1 / alpha.
  std::vector<double> squared_errors;
  std::size_t without_minimum = 0; ///< views of true trunks

  paper::LineQuartiles quartiles() const;
  /// At which the median of squared_errors is that of the chi-square distribution; NaN without any.
  double calibratedAlpha() const;
};

/// Reads the flight \p sequence by the method of the paper. Trunks of the truth count within \p range [m].
DetectorStatistics detectorStatistics(const std::string &sequence, double range = 6);

/// A table of quantiles.
std::string toTable(const DetectorStatistics &statistics);
} // namespace bole::apps
