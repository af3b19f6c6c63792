// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: the loop of rotation_em.h over one row of pixels.

#include <vector>

namespace bole
{
/// Noise of one level: variances of the flow [px^2 of the level] and of intensity.
struct LevelNoise
{
  float background, foreground, intensity, prior_logit;
};

/// One image of a level with its gradient: pixels, row by row.
struct LevelImages
{
  const float *grey, *gradient_x, *gradient_y;
};

/// What one pass knows of a row: pixel j comes from base + j by_column of the previous image, homogeneous.
struct RotationRow
{
  LevelImages previous, current; ///< current: of this row
  int row, width, height;
  float fx, fy, cx, y; ///< y: of the ray
  float base[3], by_column[3];
  LevelNoise noise;
};

/// Gauss-Newton sums of a row: upper triangle of H by rows, gradient, and how many pixels were used and had texture.
struct RotationSums
{
  float H[6] = {}, g[3] = {}, used = 0, textured = 0;
};

/// The E-step of the pixels of a row (Eq. 10 and 11) and their share of the M-step (Eq. 16). \p scratch keeps its
/// memory from row to row; \p log_ratio, where given, gets log p(r | background) - log p(r | foreground).
RotationSums sumsOfRow(const RotationRow &row, float texture_gradient, std::vector<float> &scratch, float *log_ratio);
} // namespace bole
