// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/saliency_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace bole
{
namespace
{
// Logarithm and exponential to about 1e-3, which a compiler can run four at a time.

/// Natural logarithm of a positive, normal float, absolute error below 1e-3.
inline float fastLog(float x)
{
  std::int32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  const float exponent = static_cast<float>((bits >> 23) - 127);
  bits = (bits & 0x007fffff) | 0x3f800000;
  float m; // mantissa, [1, 2)
  std::memcpy(&m, &bits, sizeof m);
  const float log2_m = -2.1536207f + m * (3.0478842f + m * (-1.0518750f + m * 0.1582484f));
  return 0.69314718f * (exponent + log2_m);
}

/// exp(x) for -80 <= x <= 80 (clamped), relative error below 1e-3.
inline float fastExp(float x)
{
  x = x < -80.f ? -80.f : (x > 80.f ? 80.f : x);
  const float y = x * 1.44269504f + 127.f;
  const std::int32_t whole = static_cast<std::int32_t>(y); // y > 0
  const float f = y - static_cast<float>(whole);
  const std::int32_t bits = whole << 23;
  float power;
  std::memcpy(&power, &bits, sizeof power);
  return power * (0.99992807f + f * (0.69326098f + f * (0.22606716f + f * 0.08074396f)));
}
} // namespace

BOLE_VECTOR_CLONES
void halvedRow(const unsigned char *upper, const unsigned char *lower, int width, float *__restrict out)
{
  for (int j = 0; j < width; ++j) {
    const int sum = upper[2 * j] + upper[2 * j + 1] + lower[2 * j] + lower[2 * j + 1];
    out[j] = (0.25f / 255.f) * static_cast<float>(sum);
  }
}

BOLE_VECTOR_CLONES
void halvedRow(const float *upper, const float *lower, int width, float *__restrict out)
{
  for (int j = 0; j < width; ++j)
    out[j] = 0.25f * (upper[2 * j] + upper[2 * j + 1] + lower[2 * j] + lower[2 * j + 1]);
}

BOLE_VECTOR_CLONES
void gradientsOfRow(const float *above, const float *row, const float *below, int width, float scale,
                    float *__restrict gx, float *__restrict gy)
{
  for (int j = 1; j < width - 1; ++j)
    gx[j] = 0.5f * (row[j + 1] - row[j - 1]);
  gx[0] = gx[width - 1] = 0;
  for (int j = 0; j < width; ++j)
    gy[j] = scale * (below[j] - above[j]);
}

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
RotationSums addPixels(const RotationRow &row, const float *columns, float *__restrict ratios)
{
  constexpr float kTextureGradient = 0.01f; // [1/px]; below, intensity noise hides a pixel of motion
  const std::ptrdiff_t n = row.width;
  const int end = row.width - 1;
  const float *is_inside = columns + kInside * n;
  const float *previous = columns + kGrey * n, *previous_x = columns + kGradientX * n,
              *previous_y = columns + kGradientY * n;
  const float *grey = row.current.grey, *gradient_x = row.current.gradient_x, *gradient_y = row.current.gradient_y;
  const LevelNoise noise = row.noise;
  const float fx = row.fx, fy = row.fy, cx = row.cx, y = row.y;
  const float inverse_fx = 1 / fx;
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
    textured += square > kTextureGradient * kTextureGradient ? inside : 0.f;
    const float w0 = weight * j0, w1 = weight * j1, w2 = weight * j2;
    h00 += w0 * j0, h01 += w0 * j1, h02 += w0 * j2, h11 += w1 * j1, h12 += w1 * j2, h22 += w2 * j2;
    g0 += w0 * r, g1 += w1 * r, g2 += w2 * r;
  }
  return {{h00, h01, h02, h11, h12, h22}, {g0, g1, g2}, used, textured};
}
} // namespace

RotationSums sumsOfRow(const RotationRow &row, std::vector<float> &scratch, float *log_ratio)
{
  const std::ptrdiff_t n = row.width;
  scratch.resize(static_cast<std::size_t>(kColumns * n));
  float *columns = scratch.data();
  placesOfRow(row, columns + kX * n, columns + kY * n, columns + kInside * n);
  sampleRow(row, columns + kX * n, columns + kY * n, columns + kInside * n, columns + kGrey * n,
            columns + kGradientX * n, columns + kGradientY * n);
  const RotationSums sums = addPixels(row, columns, columns + kRatio * n);
  if (log_ratio)
    std::copy(columns + kRatio * n + 1, columns + kColumns * n - 1, log_ratio + 1);
  return sums;
}

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
                           float *out)
{
  constexpr float kOutside = 1;
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
      out[k] = at.is_inside[k] > 0 ? r * r : kOutside;
    }
  }
}

BOLE_VECTOR_CLONES
void movedEvidenceOfRow(const RowWarp &warp, const float *evidence, int rows, float rows_per_pixel, int width,
                        float *out)
{
  constexpr float kDecay = 0.8f; // what a frame inherits
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
      at.is_inside[k] *= kDecay;
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
void addLikelihoods(float intensity, const float *flow_variance, const float *g2, const float *r2, std::size_t pixels,
                    float *__restrict evidence)
{
  constexpr float kWeight = 2.5f;
  constexpr float kUnrelated_px = 2.5f; // two unrelated places of the same texture differ as if so far apart
  float flow[kSteps];
  std::copy_n(flow_variance, kSteps, flow);
  for (std::size_t p = 0; p < pixels; ++p, r2 += kSteps, evidence += kSteps) {
    const float square = g2[p], unrelated = intensity + square * (kUnrelated_px * kUnrelated_px),
                to_unrelated = 1 / unrelated;
#pragma omp simd
    for (int k = 0; k < kSteps; ++k) {
      const float variance = intensity + square * flow[k];
      // Without texture both variances are the same, and even a perfect match says nothing.
      const float gain = std::max(2 - variance * to_unrelated, 0.5f);
      const float ratio = gain * std::sqrt(unrelated * variance) / (variance + r2[k]);
      evidence[k] += kWeight * std::max(0.f, fastLog(ratio));
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

BOLE_VECTOR_CLONES
void labelsOfRow(const float *upper, const float *lower, float share, const ColumnsBetween &columns,
                 float prior_log_odds, float *__restrict p_background, float *__restrict confidence)
{
  const int n = static_cast<int>(columns.left.size()), *left = columns.left.data();
  const float *between = columns.share.data();
#pragma omp simd
  for (int j = 0; j < n; ++j) {
    const int c = left[j];
    const float above = upper[c] + between[j] * (upper[c + 1] - upper[c]);
    const float below = lower[c] + between[j] * (lower[c + 1] - lower[c]);
    const float odds = above + share * (below - above);
    p_background[j] = 1 / (1 + fastExp(odds));
    confidence[j] = std::abs(odds - prior_log_odds);
  }
}
} // namespace bole
