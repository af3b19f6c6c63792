// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/border_scan.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace bole
{
std::vector<BorderPeak> scanBorder(const vpImage<float> &g, const BorderLine &line, double half_width_px,
                                   double contrast_min, std::size_t most)
{
  constexpr double kStep_px = 0.5; // of meanAcross()
  std::vector<BorderPeak> peaks = peaksOf(meanAcross(g, line, half_width_px + kStep_px), kStep_px, contrast_min);
  std::sort(peaks.begin(), peaks.end(),
            [](const BorderPeak &p, const BorderPeak &q) { return std::abs(p.contrast) > std::abs(q.contrast); });
  if (peaks.size() > most)
    peaks.resize(most);
  return peaks;
}

std::vector<PeakPair> pairPeaks(const std::vector<BorderPeak> &left, const std::vector<BorderPeak> &right,
                                const PairPrior &prior, std::size_t most)
{
  std::vector<PeakPair> pairs;
  pairs.reserve(std::max<std::size_t>(left.size(), 1) * std::max<std::size_t>(right.size(), 1));
  if (!left.empty() && !right.empty()) {
    const Eigen::Matrix2d information = prior.covariance_px.inverse();
    for (const BorderPeak &l : left)
      for (const BorderPeak &r : right) {
        const Eigen::Vector2d offset(l.offset_px, r.offset_px);
        pairs.push_back({l, r,
                         0.5 * offset.dot(information * offset) + contrastCost(l.contrast, prior.left_contrast) +
                             contrastCost(r.contrast, prior.right_contrast)});
      }
  }
  else {
    const int side = left.empty() ? 1 : 0;
    const double variance = prior.covariance_px(side, side);
    for (const BorderPeak &p : side == 0 ? left : right) {
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
