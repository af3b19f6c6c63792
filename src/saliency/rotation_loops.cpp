// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/rotation_loops.h"

#include "geometry/vector_clones.h"
#include "saliency/fast_math.h"

#include <algorithm>
#include <cstddef>

namespace bole
{
namespace
{
/// Numbers of each pixel of a row between the loops.
enum Column
{
  kX, // where the pixel comes from [px]
  kY,
  kInside, // 1, or 0 where that is outside the image
  kGrey,   // of the previous image there
  kGradientX,
  kGradientY,
  kRatio,
  kColumns
};

/// Where the pixels of the row come from.
BOLE_VECTOR_CLONES
void placesOfRow(const RotationRow &row, float *__restrict x, float *__restrict y, float *__restrict inside)
{
  constexpr float kNone = -1e9f;
  const int width = row.width;
  const float bx = row.base[0], by = row.base[1], bz = row.base[2];
  const float step_x = row.by_column[0], step_y = row.by_column[1], step_z = row.by_column[2];
#pragma omp simd
  for (int j = 0; j < width; ++j) {
    const float u = static_cast<float>(j), z = bz + u * step_z;
    const bool is_ahead = z > 0;
    const float inverse_z = 1 / (is_ahead ? z : 1), px = (bx + u * step_x) * inverse_z,
                py = (by + u * step_y) * inverse_z;
    x[j] = is_ahead ? px : kNone;
    y[j] = is_ahead ? py : kNone;
  }
  const float right = static_cast<float>(width - 1), bottom = static_cast<float>(row.height - 1);
#pragma omp simd
  for (int j = 0; j < width; ++j)
    inside[j] = (x[j] >= 0) & (y[j] >= 0) & (x[j] < right) & (y[j] < bottom) ? 1.f : 0.f; // 0 for NaN
}

/// Bilinear samples of the previous images.
BOLE_VECTOR_CLONES
void sampleRow(const RotationRow &row, const float *x, const float *y, const float *inside, float *__restrict grey,
               float *__restrict gradient_x, float *__restrict gradient_y)
{
  const float *from = row.previous.grey, *from_x = row.previous.gradient_x, *from_y = row.previous.gradient_y;
  const int width = row.width;
#pragma omp simd
  for (int j = 0; j < width; ++j) {
    const float px = inside[j] * x[j], py = inside[j] * y[j];
    const int column = static_cast<int>(px), line = static_cast<int>(py), at = line * width + column;
    const float a = px - static_cast<float>(column), b = py - static_cast<float>(line);
    const float w11 = a * b, w01 = a - w11, w10 = b - w11, w00 = 1 - a - w10;
    const int below = at + width;
    grey[j] = w00 * from[at] + w01 * from[at + 1] + w10 * from[below] + w11 * from[below + 1];
    gradient_x[j] = w00 * from_x[at] + w01 * from_x[at + 1] + w10 * from_x[below] + w11 * from_x[below + 1];
    gradient_y[j] = w00 * from_y[at] + w01 * from_y[at + 1] + w10 * from_y[below] + w11 * from_y[below + 1];
  }
}

BOLE_VECTOR_CLONES
RotationSums addPixels(const RotationRow &row, float texture_gradient, const float *columns, float *__restrict ratios)
{
  const std::ptrdiff_t n = row.width;
  const int end = row.width - 1;
  const float *is_inside = columns + kInside * n;
  const float *previous = columns + kGrey * n, *previous_x = columns + kGradientX * n,
              *previous_y = columns + kGradientY * n;
  const float *grey = row.current.grey, *gradient_x = row.current.gradient_x, *gradient_y = row.current.gradient_y;
  const LevelNoise noise = row.noise;
  const float fx = row.fx, fy = row.fy, cx = row.cx, y = row.y;
  const float inverse_fx = 1 / fx;
  const float texture2 = texture_gradient * texture_gradient;
  float h00 = 0, h01 = 0, h02 = 0, h11 = 0, h12 = 0, h22 = 0, g0 = 0, g1 = 0, g2 = 0, used = 0, textured = 0;
#pragma omp simd reduction(+ : h00, h01, h02, h11, h12, h22, g0, g1, g2, used, textured)
  for (int j = 1; j < end; ++j) {
    const float u = static_cast<float>(j), x = (u - cx) * inverse_fx, inside = is_inside[j];
    const float gx = 0.5f * (previous_x[j] + gradient_x[j]), gy = 0.5f * (previous_y[j] + gradient_y[j]);
    const float r = grey[j] - previous[j];
    // the flow V omega of Eq. 14 by omega, times the gradient
    const float j0 = gx * fx * x * y + gy * fy * (1 + y * y);
    const float j1 = -gx * fx * (1 + x * x) - gy * fy * x * y;
    const float j2 = gx * fx * y - gy * fy * x;
    const float square = gx * gx + gy * gy;
    const float var_b = noise.intensity + square * noise.background;
    const float var_f = noise.intensity + square * noise.foreground;
    const float of_b = 1 / var_b, of_f = 1 / var_f;
    const float ratio = 0.5f * (fastLog(var_f * of_b) - r * r * of_b + r * r * of_f);
    // M-step (Eq. 16): expected negative log-likelihood.
    const float p_b = 1.f / (1.f + fastExp(-(ratio + noise.prior_logit)));
    const float weight = inside * (p_b * of_b + (1 - p_b) * of_f);
    ratios[j] = inside * ratio;
    used += inside;
    textured += square > texture2 ? inside : 0.f;
    const float w0 = weight * j0, w1 = weight * j1, w2 = weight * j2;
    h00 += w0 * j0, h01 += w0 * j1, h02 += w0 * j2, h11 += w1 * j1, h12 += w1 * j2, h22 += w2 * j2;
    g0 += w0 * r, g1 += w1 * r, g2 += w2 * r;
  }
  return {{h00, h01, h02, h11, h12, h22}, {g0, g1, g2}, used, textured};
}
} // namespace

RotationSums sumsOfRow(const RotationRow &row, float texture_gradient, std::vector<float> &scratch, float *log_ratio)
{
  const std::ptrdiff_t n = row.width;
  scratch.resize(static_cast<std::size_t>(kColumns * n));
  float *columns = scratch.data();
  placesOfRow(row, columns + kX * n, columns + kY * n, columns + kInside * n);
  sampleRow(row, columns + kX * n, columns + kY * n, columns + kInside * n, columns + kGrey * n,
            columns + kGradientX * n, columns + kGradientY * n);
  const RotationSums sums = addPixels(row, texture_gradient, columns, columns + kRatio * n);
  if (log_ratio)
    std::copy(columns + kRatio * n + 1, columns + kColumns * n - 1, log_ratio + 1);
  return sums;
}
} // namespace bole
