// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/border_scan.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kStep = 0.5; // [px]

/// How well a contrast continues the one of the frames before, or how strong it is where there is none.
double contrastCost(double contrast, const std::optional<double> &before)
{
  if (before) {
    const double sigma = 0.3 * std::abs(*before) + 0.01;
    const double z = (contrast - *before) / sigma;
    return 0.5 * std::min(z * z, 16.0);
  }
  return -2 * std::min(std::abs(contrast) / 0.03, 2.0);
}
} // namespace

std::vector<ScanPeak> scanBorder(const vpImage<float> &g, const BorderLine &line, double half_width_px,
                                 double contrast_min, std::size_t most)
{
  const int n = static_cast<int>(std::ceil(half_width_px / kStep));
  std::vector<double> profile(static_cast<std::size_t>(2 * n + 3));
  for (int i = -n - 1; i <= n + 1; ++i)
    profile[static_cast<std::size_t>(i + n + 1)] = meanAlongOnly(g, line.moved(i * kStep, i * kStep));

  std::vector<ScanPeak> peaks;
  for (std::size_t i = 1; i + 1 < profile.size(); ++i) {
    const double a = std::abs(profile[i - 1]), b = std::abs(profile[i]), c = std::abs(profile[i + 1]);
    if (b < contrast_min || b < a || b <= c)
      continue;
    const double bend = a - 2 * b + c;
    const double shift = bend < 0 ? std::clamp(0.5 * (a - c) / bend, -0.5, 0.5) : 0;
    const double height = b - 0.25 * (a - c) * shift;
    peaks.push_back({(static_cast<double>(i) - n - 1 + shift) * kStep, std::copysign(height, profile[i])});
  }
  std::sort(peaks.begin(), peaks.end(),
            [](const ScanPeak &p, const ScanPeak &q) { return std::abs(p.contrast) > std::abs(q.contrast); });
  if (peaks.size() > most)
    peaks.resize(most);
  return peaks;
}

std::vector<PeakPair> pairPeaks(const std::vector<ScanPeak> &left, const std::vector<ScanPeak> &right,
                                const PairPrior &prior, std::size_t most)
{
  std::vector<PeakPair> pairs;
  if (!left.empty() && !right.empty()) {
    const Eigen::Matrix2d information = prior.covariance_px.inverse();
    for (const ScanPeak &l : left)
      for (const ScanPeak &r : right) {
        const Eigen::Vector2d offset(l.offset_px, r.offset_px);
        pairs.push_back({l, r,
                         0.5 * offset.dot(information * offset) + contrastCost(l.contrast, prior.left_contrast) +
                             contrastCost(r.contrast, prior.right_contrast)});
      }
  }
  else {
    const int side = left.empty() ? 1 : 0;
    const double variance = prior.covariance_px(side, side);
    for (const ScanPeak &p : side == 0 ? left : right) {
      const double cost = 0.5 * p.offset_px * p.offset_px / variance +
                          contrastCost(p.contrast, side == 0 ? prior.left_contrast : prior.right_contrast);
      pairs.push_back(side == 0 ? PeakPair{p, {}, cost} : PeakPair{{}, p, cost});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const PeakPair &p, const PeakPair &q) { return p.cost < q.cost; });
  if (pairs.size() > most)
    pairs.resize(most);
  return pairs;
}
} // namespace bole
