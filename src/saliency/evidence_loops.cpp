// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/evidence_loops.h"

#include "geometry/vector_clones.h"
#include "saliency/fast_math.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr int kSteps = kInverseDepths;

/// Where the steps of one pixel come from in the older image. What is outside is held at its edge.
struct StepPlaces
{
  float x[kSteps], y[kSteps], inverse_z[kSteps], is_inside[kSteps];
};

inline void locate(const RowWarp &warp, int column, StepPlaces &at)
{
  const float j = static_cast<float>(column), max_x = warp.max_x, max_y = warp.max_y;
  const float bx = warp.base[0] + j * warp.by_column[0], by = warp.base[1] + j * warp.by_column[1],
              bz = warp.base[2] + j * warp.by_column[2];
#pragma omp simd
  for (int k = 0; k < kSteps; ++k) {
    const float z = bz + warp.rho[k] * warp.e[2];
    const float inverse_z = 1 / (z > 0.1f ? z : 0.1f);
    const float x = (bx + warp.rho[k] * warp.e[0]) * inverse_z, y = (by + warp.rho[k] * warp.e[1]) * inverse_z;
    const float held_x = std::min(max_x, std::max(0.f, x)), held_y = std::min(max_y, std::max(0.f, y)); // 0 for NaN
    at.is_inside[k] = (z > 0.1f) & (held_x == x) & (held_y == y) ? 1.f : 0.f; // not behind the older camera
    at.inverse_z[k] = inverse_z;
    at.x[k] = held_x;
    at.y[k] = held_y;
  }
}
} // namespace

BOLE_VECTOR_CLONES
void squaredResidualsOfRow(const RowWarp &warp, const float *older, int stride, const float *here, int width,
                           float outside, float *out)
{
  StepPlaces at;
  int offset[kSteps];
  for (int j = 0; j < width; ++j, out += kSteps) {
    locate(warp, j, at);
#pragma omp simd
    for (int k = 0; k < kSteps; ++k) {
      const int column = static_cast<int>(at.x[k]), row = static_cast<int>(at.y[k]);
      offset[k] = row * stride + column;
      at.x[k] -= static_cast<float>(column);
      at.y[k] -= static_cast<float>(row);
    }
    const float *lower = older + stride, grey = here[j];
#pragma omp simd
    for (int k = 0; k < kSteps; ++k) {
      const float p0 = older[offset[k]], p1 = older[offset[k] + 1], q0 = lower[offset[k]], q1 = lower[offset[k] + 1];
      const float upper = p0 + at.x[k] * (p1 - p0), under = q0 + at.x[k] * (q1 - q0);
      const float r = grey - upper - at.y[k] * (under - upper);
      out[k] = at.is_inside[k] > 0 ? r * r : outside;
    }
  }
}

BOLE_VECTOR_CLONES
void movedEvidenceOfRow(const RowWarp &warp, const float *evidence, int rows, float rows_per_pixel, int width,
                        float decay, float *out)
{
  constexpr float kLastStep = kSteps - 1.001f;
  StepPlaces at;
  int offset[kSteps];
  float share[kSteps];
  for (int j = 0; j < width; ++j, out += kSteps) {
    locate(warp, j, at);
#pragma omp simd
    for (int k = 0; k < kSteps; ++k) {
      // Steps go with the square root of the inverse depth, which in the older frame is rho / z.
      const float position = std::min(static_cast<float>(k) * std::sqrt(at.inverse_z[k]), kLastStep);
      const int step = static_cast<int>(position), column = static_cast<int>(at.x[k]);
      const int row = std::min(static_cast<int>(at.y[k] * rows_per_pixel + 0.5f), rows - 1);
      offset[k] = (row * width + column) * kSteps + step;
      share[k] = position - static_cast<float>(step);
      at.x[k] -= static_cast<float>(column);
      at.is_inside[k] *= decay;
    }
#pragma omp simd
    for (int k = 0; k < kSteps; ++k) {
      const float p0 = evidence[offset[k]], p1 = evidence[offset[k] + 1];
      const float q0 = evidence[offset[k] + kSteps], q1 = evidence[offset[k] + kSteps + 1];
      const float left = p0 + share[k] * (p1 - p0), right = q0 + share[k] * (q1 - q0);
      out[k] = at.is_inside[k] * (left + at.x[k] * (right - left));
    }
  }
}

BOLE_VECTOR_CLONES
void slidingMeans(const float *in, int n, int lag, int window, float *__restrict out)
{
  const float scale = 1.f / static_cast<float>(window);
  for (int i = 0; i < n; ++i)
    out[i] = scale * in[i];
  for (int t = 1; t < window; ++t) {
    const float *later = in + t * lag;
    for (int i = 0; i < n; ++i)
      out[i] += scale * later[i];
  }
}

BOLE_VECTOR_CLONES
void meansDownColumns(const float *in, int rows, int columns, int window, float *__restrict sum, float *__restrict out)
{
  const int half = window / 2;
  const float scale = 1.f / static_cast<float>(window);
  const auto at = [=](int i) { return in + static_cast<std::ptrdiff_t>(std::clamp(i, 0, rows - 1)) * columns; };
  std::fill(sum, sum + columns, 0.f);
  for (int i = -half; i <= half; ++i) {
    const float *enter = at(i);
    for (int k = 0; k < columns; ++k)
      sum[k] += enter[k];
  }
  for (int i = 0; i < rows; ++i, out += columns) {
    const float *enter = at(i + half + 1), *leave = at(i - half);
    for (int k = 0; k < columns; ++k) {
      out[k] = sum[k] * scale;
      sum[k] += enter[k] - leave[k];
    }
  }
}

BOLE_VECTOR_CLONES
void squaresOfRow(const float *gradient_x, const float *gradient_y, int width, float *__restrict out)
{
  for (int j = 0; j < width; ++j)
    out[j] = gradient_x[j] * gradient_x[j] + gradient_y[j] * gradient_y[j];
}

BOLE_VECTOR_CLONES
void addLikelihoods(const LikelihoodTerms &terms, const float *g2, const float *r2, std::size_t pixels,
                    float *__restrict evidence)
{
  float flow_variance[kSteps];
  std::copy_n(terms.flow_variance, kSteps, flow_variance);
  const float intensity = terms.intensity, weight = terms.weight;
  for (std::size_t p = 0; p < pixels; ++p, r2 += kSteps, evidence += kSteps) {
    const float square = g2[p], unrelated = intensity + square * terms.unrelated, to_unrelated = 1 / unrelated;
    if (!terms.is_relative) {
#pragma omp simd
      for (int k = 0; k < kSteps; ++k) {
        const float variance = intensity + square * flow_variance[k];
        evidence[k] += weight * fastLog(std::sqrt(variance) / (variance + r2[k]));
      }
      continue;
    }
#pragma omp simd
    for (int k = 0; k < kSteps; ++k) {
      const float variance = intensity + square * flow_variance[k];
      // Without texture both variances are the same, and even a perfect match says nothing.
      const float gain = std::max(2 - variance * to_unrelated, 0.5f);
      const float ratio = gain * std::sqrt(unrelated * variance) / (variance + r2[k]);
      evidence[k] += weight * std::max(0.f, fastLog(ratio));
    }
  }
}

BOLE_VECTOR_CLONES
void logOddsOfEvidence(const float *evidence, const float *log_prior, const float *is_near, std::size_t pixels,
                       float *__restrict log_odds)
{
  float prior[kSteps], share[kSteps];
  std::copy_n(log_prior, kSteps, prior);
  std::copy_n(is_near, kSteps, share);
  for (std::size_t p = 0; p < pixels; ++p, evidence += kSteps) {
    const float first = evidence[0]; // any will do: what is gathered stays far from where fastExp() is clamped
    float near = 1e-20f, far = 1e-20f;
#pragma omp simd reduction(+ : near, far)
    for (int k = 0; k < kSteps; ++k) {
      const float weight = fastExp(evidence[k] - first + prior[k]);
      near += share[k] * weight;
      far += (1 - share[k]) * weight;
    }
    log_odds[p] = near / far;
  }
  for (std::size_t p = 0; p < pixels; ++p)
    log_odds[p] = fastLog(log_odds[p]);
}
} // namespace bole
