// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/level_image.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Vector3d;

namespace
{
/// Mean of one band along a column; false where less than this share of it is in the image.
constexpr double kLeastSeen = 0.6;

bool addBand(const vpImage<unsigned char> &image, const PinholeCamera &camera, const Vector3d &low,
             const Vector3d &high, int samples, float &mean)
{
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
  if (seen < kLeastSeen * samples)
    return false;
  mean = sum / (255.f * static_cast<float>(seen));
  return true;
}

/// Central differences, where both neighbours show the band; without them a column is not compared.
void findSlopes(std::vector<LevelColumn> &columns)
{
  std::vector<unsigned> seen;
  seen.reserve(columns.size());
  for (const LevelColumn &column : columns)
    seen.push_back(column.bands);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const bool is_inside = i > 0 && i + 1 < columns.size();
    columns[i].bands = is_inside ? seen[i - 1] & seen[i] & seen[i + 1] : 0;
    if (is_inside)
      for (std::size_t b = 0; b < kLevelBands; ++b)
        columns[i].slope[b] = 0.5f * (columns[i + 1].value[b] - columns[i - 1].value[b]);
  }
}

double contrastOf(const std::vector<LevelColumn> &columns)
{
  double variance = 0;
  int bands = 0;
  for (std::size_t b = 0; b < kLevelBands; ++b) {
    double sum = 0, squares = 0;
    int n = 0;
    for (const LevelColumn &column : columns)
      if (column.bands >> b & 1U) {
        sum += column.value[b];
        squares += column.value[b] * column.value[b];
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

LevelColumn LevelImage::at(double q, double lean) const
{
  LevelColumn column;
  const double by_elevation = lean * (1 + q * q);
  for (std::size_t b = 0; b < kLevelBands; ++b) {
    const double x = (q + by_elevation * elevation[b] - q_first) / step;
    if (!(x >= 0) || x >= static_cast<double>(columns.size() - 1))
      continue;
    const auto i = static_cast<std::size_t>(x);
    const LevelColumn &l = columns[i], &r = columns[i + 1];
    const auto a = static_cast<float>(x - static_cast<double>(i));
    column.value[b] = l.value[b] + a * (r.value[b] - l.value[b]);
    column.slope[b] = l.slope[b] + a * (r.slope[b] - l.slope[b]);
    column.bands |= l.bands & r.bands & 1U << b;
  }
  return column;
}

LevelImage computeLevelImage(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                             const Eigen::Matrix3d &wRc, const ElevationRange &range)
{
  constexpr double kFinest = 1.0 / 300; // of a column: finer than the roughness of bark
  constexpr int kLeast = 5, kMost = 16; // samples of a band
  LevelImage level;
  const Vector3d forward = wRc.col(2);
  level.cRl =
      wRc.transpose() * Eigen::AngleAxisd(std::atan2(forward.y(), forward.x()), Vector3d::UnitZ()).toRotationMatrix();
  level.step = std::max(1 / camera.fx, kFinest);
  const double q_max = 1.1 * std::max(camera.cx, camera.width - camera.cx) / camera.fx;
  const int half = static_cast<int>(q_max / level.step);
  level.q_first = -half * level.step;
  level.columns.resize(static_cast<std::size_t>(2 * half + 1));
  const double band = (range.high - range.low) / kLevelBands;
  for (int b = 0; b < kLevelBands; ++b)
    level.elevation[static_cast<std::size_t>(b)] = range.low + (b + 0.5) * band;
  const int samples = std::clamp(static_cast<int>(band * camera.fy / 3), kLeast, kMost);
  for (int i = -half; i <= half; ++i) {
    LevelColumn &column = level.columns[static_cast<std::size_t>(i + half)];
    const double q = i * level.step, horizontal = std::hypot(1, q);
    for (int b = 0; b < kLevelBands; ++b) {
      const double bottom = range.low + b * band;
      const Vector3d low = level.cRl * Vector3d(1, q, (bottom + 0.05 * band) * horizontal);
      const Vector3d high = level.cRl * Vector3d(1, q, (bottom + 0.95 * band) * horizontal);
      if (addBand(image, camera, low, high, samples, column.value[static_cast<std::size_t>(b)]))
        column.bands |= 1U << b;
    }
  }
  findSlopes(level.columns);
  level.contrast = contrastOf(level.columns);
  return level;
}
} // namespace bole
