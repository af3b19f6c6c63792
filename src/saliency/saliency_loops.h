// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: its loops over the pixels of a row or an image.

#include <cstddef>
#include <vector>

namespace bole
{
// Rows of an image of half the size, and of the gradient of an image.

/// out[j] = mean of the four pixels above and below at 2 j and 2 j + 1; bytes become 1 = full scale.
void halvedRow(const unsigned char *upper, const unsigned char *lower, int width, float *out);
void halvedRow(const float *upper, const float *lower, int width, float *out);

/// Central differences of a row, along it (none at its ends) and to those \p above and \p below times \p scale.
void gradientsOfRow(const float *above, const float *row, const float *below, int width, float scale, float *gx,
                    float *gy);

// The loop of estimateRotation() over one row of pixels.

/// Noise of one level: variances of the flow [px^2 of the level] and of intensity.
struct LevelNoise
{
  float background, foreground, intensity, prior_logit;
};

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
RotationSums sumsOfRow(const RotationRow &row, std::vector<float> &scratch, float *log_ratio);

// The loops of InverseDepthEvidence over one row of pixels, each pixel with all its steps of inverse depth.

constexpr int kInverseDepths = 16; ///< steps of the sweep from infinity to min_range: two registers of AVX2

/// A row of pixels (j, v) as it is seen in the older image: base + j by_column + rho e, homogeneous.
struct RowWarp
{
  float base[3], by_column[3], e[3];
  const float *rho;   ///< of each step
  float max_x, max_y; ///< of a bilinear sample in the older image
};

/// out[step] of each pixel: squared difference of \p here and \p older; where the older image ends as bad as any, so
/// that it says nothing.
void squaredResidualsOfRow(const RowWarp &warp, const float *older, int stride, const float *here, int width,
                           float *out);

/// out[step] of each pixel: a share of the evidence of the place and depth that it was in the older frame; 0 where
/// there was none.
void movedEvidenceOfRow(const RowWarp &warp, const float *evidence, int rows, float rows_per_pixel, int width,
                        float *out);

/// out[i] = mean of the \p window numbers in[i], in[i + lag], ...
void slidingMeans(const float *in, int n, int lag, int window, float *out);

/// Running means of \p columns numbers a row over \p window rows; the ends repeat. \p sum: memory for \p columns.
void meansDownColumns(const float *in, int rows, int columns, int window, float *sum, float *out);

void squaresOfRow(const float *gradient_x, const float *gradient_y, int width, float *out);

/// Adds the log-likelihood of the windows' residuals \p r2, against that of unrelated windows, to \p evidence of \p
/// pixels pixels. \p g2: mean square gradients, \p intensity: variance, \p flow_variance: of each step [px^2].
void addLikelihoods(float intensity, const float *flow_variance, const float *g2, const float *r2, std::size_t pixels,
                    float *evidence);

/// log p(near) - log p(far) of each pixel; \p is_near: 1 or 0 for each step.
void logOddsOfEvidence(const float *evidence, const float *log_prior, const float *is_near, std::size_t pixels,
                       float *log_odds);

// Labels of the pixels of one row from log odds at a coarser level.

/// Between which columns of the coarser image each pixel lies, and how far from the left one.
struct ColumnsBetween
{
  std::vector<int> left;
  std::vector<float> share;
};

/// \p upper and \p lower: the rows of log odds above and below, \p share: how far from the upper one.
void labelsOfRow(const float *upper, const float *lower, float share, const ColumnsBetween &columns,
                 float prior_log_odds, float *p_background, float *confidence);
} // namespace bole
