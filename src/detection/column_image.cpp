// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/photo_consistency.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace bole
{
using Eigen::Vector3d;

namespace
{
constexpr float kUnseen = std::numeric_limits<float>::quiet_NaN();

/// Mean of one band along a column; NaN where less than a share of it is in the image.
float meanOfBand(const vpImage<unsigned char> &image, const PinholeCamera &camera, const Vector3d &low,
                 const Vector3d &high, int samples)
{
  constexpr double kLeastSeen = 0.6;
  const int width = camera.width, height = camera.height;
  const Vector3d step = (high - low) / (samples - 1);
  Vector3d c = low;
  float sum = 0;
  int seen = 0;
  for (int i = 0; i < samples; ++i, c += step) {
    if (c.z() <= 0)
      continue;
    const double by_z = 1 / c.z();
    const double u = camera.fx * c.x() * by_z + camera.cx, v = camera.fy * c.y() * by_z + camera.cy;
    if (u < 0 || v < 0 || u >= width - 1 || v >= height - 1)
      continue;
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const auto a = static_cast<float>(u - x), b = static_cast<float>(v - y);
    const unsigned char *p = image[y] + x, *q = image[y + 1] + x;
    sum += (1 - b) * ((1 - a) * p[0] + a * p[1]) + b * ((1 - a) * q[0] + a * q[1]);
    ++seen;
  }
  return seen < kLeastSeen * samples ? kUnseen : sum / (255.f * static_cast<float>(seen));
}

/// Central differences; NaN beside a column that does not show the band: it is not compared.
std::vector<float> slopesOf(const std::vector<float> &value)
{
  std::vector<float> slope(value.size(), kUnseen);
  for (std::size_t i = 1; i + 1 < value.size(); ++i)
    if (!std::isnan(value[i]))
      slope[i] = 0.5f * (value[i + 1] - value[i - 1]);
  return slope;
}

double contrastOf(const ColumnImage &level)
{
  double variance = 0;
  int bands = 0;
  for (std::size_t b = 0; b < kLevelBands; ++b) {
    double sum = 0, squares = 0;
    int n = 0;
    for (std::size_t i = 0; i < level.columns(); ++i)
      if (!std::isnan(level.slope[b][i])) {
        const float value = level.value[b][i];
        sum += value;
        squares += value * value;
        ++n;
      }
    if (n > 1) {
      variance += squares / n - sum / n * (sum / n);
      ++bands;
    }
  }
  return bands > 0 ? std::sqrt(std::max(variance / bands, 0.0)) : 0;
}
} // namespace

LevelColumn ColumnImage::at(double q, double lean) const
{
  LevelColumn column;
  const double by_elevation = lean * (1 + q * q);
  for (std::size_t b = 0; b < kLevelBands; ++b) {
    const double x = (q + by_elevation * elevation[b] - q_first) / step;
    const bool is_inside = x >= 0 && x < static_cast<double>(columns() - 1);
    const auto i = static_cast<std::size_t>(is_inside ? x : 0);
    const float share = is_inside ? static_cast<float>(x - static_cast<double>(i)) : kUnseen;
    column.value[b] = value[b][i] + share * (value[b][i + 1] - value[b][i]);
    column.slope[b] = slope[b][i] + share * (slope[b][i + 1] - slope[b][i]);
  }
  return column;
}

ColumnImage computeColumnImage(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                               const Eigen::Matrix3d &wRc, const ElevationRange &range)
{
  constexpr double kFinest = 1.0 / 300; // of a column: finer than the roughness of bark
  constexpr int kLeast = 5, kMost = 16; // samples of a band
  ColumnImage level;
  const Vector3d forward = wRc.col(2);
  level.cRl =
      wRc.transpose() * Eigen::AngleAxisd(std::atan2(forward.y(), forward.x()), Vector3d::UnitZ()).toRotationMatrix();
  level.step = std::max(1 / camera.fx, kFinest);
  const double q_max = 1.1 * std::max(camera.cx, camera.width - camera.cx) / camera.fx;
  const int half = static_cast<int>(q_max / level.step);
  level.q_first = -half * level.step;
  const double band = (range.high - range.low) / kLevelBands;
  for (int b = 0; b < kLevelBands; ++b) {
    level.elevation[static_cast<std::size_t>(b)] = range.low + (b + 0.5) * band;
    level.value[static_cast<std::size_t>(b)].resize(static_cast<std::size_t>(2 * half + 1));
  }
  const int samples = std::clamp(static_cast<int>(band * camera.fy / 3), kLeast, kMost);
  for (int i = -half; i <= half; ++i) {
    const double q = i * level.step, horizontal = std::hypot(1, q);
    for (int b = 0; b < kLevelBands; ++b) {
      const double bottom = range.low + b * band;
      const Vector3d low = level.cRl * Vector3d(1, q, (bottom + 0.05 * band) * horizontal);
      const Vector3d high = level.cRl * Vector3d(1, q, (bottom + 0.95 * band) * horizontal);
      level.value[static_cast<std::size_t>(b)][static_cast<std::size_t>(i + half)] =
          meanOfBand(image, camera, low, high, samples);
    }
  }
  for (std::size_t b = 0; b < kLevelBands; ++b)
    level.slope[b] = slopesOf(level.value[b]);
  level.contrast = contrastOf(level);
  return level;
}
} // namespace bole
