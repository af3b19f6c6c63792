// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: the loops of InverseDepthEvidence over one row of pixels, each pixel with all its steps of
// inverse depth.

#include <cstddef>

namespace bole
{
constexpr int kInverseDepths = 16; ///< steps of the sweep from infinity to min_range: two registers of AVX2

/// A row of pixels (j, v) as it is seen in the older image: base + j by_column + rho e, homogeneous.
struct RowWarp
{
  float base[3], by_column[3], e[3];
  const float *rho;   ///< of each step
  float max_x, max_y; ///< of a bilinear sample in the older image
};

/// out[step] of each pixel: squared difference of \p here and \p older; \p outside where the older image ends.
void squaredResidualsOfRow(const RowWarp &warp, const float *older, int stride, const float *here, int width,
                           float outside, float *out);

/// out[step] of each pixel: \p decay times the evidence of the place and depth that it was in the older frame; 0 where
/// there was none. \p step_of_k: root of the inverse depth of each step, in steps.
void movedEvidenceOfRow(const RowWarp &warp, const float *evidence, int rows, float rows_per_pixel, int width,
                        float decay, float *out);

/// out[i] = mean of the \p window numbers in[i], in[i + lag], ...
void slidingMeans(const float *in, int n, int lag, int window, float *out);

/// Running means of \p columns numbers a row over \p window rows; the ends repeat. \p sum: memory for \p columns.
void meansDownColumns(const float *in, int rows, int columns, int window, float *sum, float *out);

/// Squares of the gradient of a row.
void squaresOfRow(const float *gradient_x, const float *gradient_y, int width, float *out);

/// What the likelihood of a window's residual is made of.
struct LikelihoodTerms
{
  float intensity;            ///< variance
  float unrelated;            ///< variance of the flow between unrelated windows [px^2]
  const float *flow_variance; ///< of each step [px^2]
  float weight;
  bool is_relative;
};

/// Adds the log-likelihood of \p r2 to \p evidence of \p pixels pixels; \p g2: mean square gradients.
void addLikelihoods(const LikelihoodTerms &terms, const float *g2, const float *r2, std::size_t pixels,
                    float *evidence);

/// log p(near) - log p(far) of each pixel; \p is_near: 1 or 0 for each step.
void logOddsOfEvidence(const float *evidence, const float *log_prior, const float *is_near, std::size_t pixels,
                       float *log_odds);
} // namespace bole
