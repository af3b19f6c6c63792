// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: the loops of the detector over its window of views and over the ranges that it sweeps.

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
} // namespace bole
