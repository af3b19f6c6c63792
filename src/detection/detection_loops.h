// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: the loops of the detector over its window of views and over the ranges that it sweeps, and the
// one that compares a column of a rectified column image with another image.
#include <array>
#include <vector>

namespace bole
{
/// The views of the window on the ground plane, number by number: their places and the axes of the level cameras, and
/// of their profiles, one after the other, the peaks nearest to each sample.
struct ViewColumns
{
  std::vector<float> x, y, forward_x, forward_y, left_x, left_y; ///< from a place among them
  std::vector<float> q_first, q_last, by_step;
  std::vector<int> first_sample; ///< of each view in the peaks
  std::vector<float> rising_peak, falling_peak;
};

/// A circle on the ground, and whether its borders in the image rise from dark to bright.
struct Circle
{
  float x, y, r;
  bool left_rises, right_rises;
};

/// Normal equations of the columns of the borders against their nearest peaks, by (x, y, log r): upper triangle of H by
/// rows and gradient. Only residuals below the gate count.
struct BorderSums
{
  float H[6] = {}, g[3] = {};
  float views = 0, inliers = 0, squares = 0; ///< inliers: both borders within the gate; squares: theirs [px^2]
};
BorderSums sumsOfBorders(const ViewColumns &views, const Circle &circle, float px_per_q, float gate_px);

/// A view that a border is looked for in: q = (left0 + range left1) / (ahead0 + range ahead1).
struct SweptView
{
  float ahead0, ahead1, left0, left1;
  float q_first, by_step; ///< of the profile
  const float *profile;   ///< strongest values of the border's sign
  int samples;
};

/// Adds to \p sum how well the profile continues a contrast at each range, and to \p seen where it says anything.
void addAgreement(const SweptView &view, float by_contrast, const float *ranges, int count, float *sum, float *seen);

/// Mean agreement of two borders at each range that at least \p views_min views see of each; -1 elsewhere. Returns the
/// best.
struct BorderCurve
{
  const float *sum, *seen;
};
float scoresOfPair(const BorderCurve &left, const BorderCurve &right, int count, float views_min, float *scores);

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
