// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The loop that compares a column of one rectified column image with another image, over the ranges tried.

#include <array>

namespace bole
{
constexpr int kLevelBands = 4; ///< of elevation, of equal height in its tangent

/// What one column shows: mean brightness of each band [full scale] and its slope from column to column; NaN where the
/// band is not in the image.
struct LevelColumn
{
  std::array<float, kLevelBands> value, slope;
};

/// What the column would show in the other image, on the ground plane: at range r, (ahead0 + r ahead1) before its
/// camera, (left0 + r left1) to the left, and leaning across the line of sight by (across0 + r across1) over its range.
struct CarriedColumn
{
  float ahead0, ahead1, left0, left1, across0, across1;
  float hidden_first, hidden_last; ///< tan of the bearings between which what is beyond \p hidden_beyond is hidden
  float hidden_beyond;             ///< [m]
};

/// The other image: brightness and slope of each band, column by column from bearing \p q_first on; NaN where a band is
/// not in the image.
struct OtherColumns
{
  float q_first, by_step; ///< tan of the bearing; columns per 1
  int count;
  std::array<const float *, kLevelBands> value, slope;
  std::array<float, kLevelBands> elevation; ///< tan
};

/// Mean over the bands that both show of squared differences, each cut at 4, at each of \p ranges; negative where there
/// are none. \p by_value, \p by_slope: 1 over the unit of a difference.
void differencesAtRanges(const LevelColumn &column, const CarriedColumn &carried, const OtherColumns &other,
                         float by_value, float by_slope, const float *ranges, int n, float *differences);
} // namespace bole
