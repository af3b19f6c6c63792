// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/detector.h"

#include "geometry/median.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace bole
{
using Eigen::Vector3d;

namespace
{
/// Least part of the line inside the image, or of the image that it crosses: a shorter one says little.
constexpr double kLeastRows = 0.4;

/// Extremes within two samples, a pixel.
void findExtremes(LevelProfile &profile)
{
  const auto &p = profile.mean;
  profile.rising.assign(p.size(), 0.f);
  profile.falling.assign(p.size(), 0.f);
  for (std::size_t i = 2; i + 2 < p.size(); ++i) {
    const auto [low, high] =
        std::minmax_element(p.begin() + static_cast<long>(i) - 2, p.begin() + static_cast<long>(i) + 3);
    profile.rising[i] = std::max(*high, 0.f);
    profile.falling[i] = std::min(*low, 0.f);
  }
}

void findPeaks(LevelProfile &profile, double contrast_min)
{
  const auto &p = profile.mean;
  for (std::size_t i = 1; i + 1 < p.size(); ++i) {
    const double a = std::abs(p[i - 1]), b = std::abs(p[i]), c = std::abs(p[i + 1]);
    if (b < contrast_min || b < a || b <= c)
      continue;
    const double shift = peakOffset(a, b, c);
    profile.peaks.push_back({profile.q_first + profile.step * (static_cast<double>(i) + shift),
                             std::copysign(b - 0.25 * (a - c) * shift, p[i])});
  }
}
/// For each sample the peak of one polarity that is nearest: between two peaks it changes half-way.
std::vector<float> nearestPeaks(const LevelProfile &profile, double sign)
{
  std::vector<float> nearest(profile.mean.size(), std::numeric_limits<float>::quiet_NaN());
  std::size_t begin = 0;
  double before = 0;
  bool is_first = true;
  const auto fill = [&](std::size_t end, double q) {
    for (; begin < std::min(end, nearest.size()); ++begin)
      nearest[begin] = static_cast<float>(q);
  };
  for (const ProfilePeak &peak : profile.peaks) {
    if (peak.contrast * sign <= 0)
      continue;
    if (!is_first)
      fill(static_cast<std::size_t>(std::ceil((0.5 * (before + peak.q) - profile.q_first) / profile.step)), before);
    before = peak.q;
    is_first = false;
  }
  if (!is_first)
    fill(nearest.size(), before);
  return nearest;
}
} // namespace

std::optional<double> meanAlong(const vpImage<float> &image, const PinholeCamera &camera, const LevelProfile &profile,
                                double q, const ElevationRange &range)
{
  const double horizontal = std::hypot(1, q), by_elevation = profile.lean * (1 + q * q);
  const auto at = [&](double elevation) -> Vector3d {
    return profile.cRl * Vector3d(1, q + by_elevation * elevation, elevation * horizontal);
  };
  const Vector3d low = at(range.low), high = at(range.high);
  const BorderLine line = clippedLine(camera, low.cross(high).normalized(), low, high, 1);
  const double rows_full = std::min(camera.fy * (range.high - range.low) * horizontal, double(camera.height));
  if (line.rows() * std::hypot(1, line.slope) < kLeastRows * rows_full)
    return std::nullopt;
  return meanAlongOnly(image, line);
}

LevelProfile computeLevelProfile(const vpImage<float> &g, const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                                 const ProfileOptions &options)
{
  LevelProfile profile;
  const Vector3d forward = wRc.col(2);
  const double heading = std::atan2(forward.y(), forward.x());
  profile.cRl = wRc.transpose() * Eigen::AngleAxisd(heading, Vector3d::UnitZ()).toRotationMatrix();
  profile.lean = options.lean;
  profile.step = 0.5 / camera.fx;
  const double q_max = 1.15 * std::max(camera.cx, camera.width - camera.cx) / camera.fx;
  const int half = static_cast<int>(q_max / profile.step);
  profile.q_first = -half * profile.step;
  profile.mean.assign(static_cast<std::size_t>(2 * half + 1), 0.f);

  for (int i = -half; i <= half; ++i)
    profile.mean[static_cast<std::size_t>(i + half)] =
        static_cast<float>(meanAlong(g, camera, profile, i * profile.step, options.range).value_or(0));
  findExtremes(profile);
  findPeaks(profile, options.contrast_min);
  profile.rising_peak = nearestPeaks(profile, 1);
  profile.falling_peak = nearestPeaks(profile, -1);
  return profile;
}
} // namespace bole
