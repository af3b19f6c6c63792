// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/line_detector.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

namespace bole
{
namespace
{
double logistic(double x, double a, double b) { return 1 / (1 + std::exp(a * x + b)); }

/// Eq. 21 put right; distances in the image from the column to the nearest bark.
double notInhibited(double q, const std::vector<InhibitedRange> &known, double fx, double sigma_px)
{
  double sum = 0;
  for (const InhibitedRange &range : known) {
    const double d_px = fx * std::max({0.0, q - range.q_left, range.q_right - q});
    sum += std::exp(-0.5 * d_px * d_px / (sigma_px * sigma_px));
  }
  return 1 - std::min(1.0, sum);
}

struct Line
{
  double q, p;
  double contrast; ///< signed
};

/// How much likelier a pair of borders is to be a trunk for its polarities: bark is mostly darker than what is behind
/// it, seldom brighter on one side alone.
double polarityWeight(const Line &left, const Line &right)
{
  if (left.contrast < 0 && right.contrast > 0)
    return 1;
  return left.contrast * right.contrast < 0 ? 0.4 : 0.2;
}

/// Local maxima of the probability above the threshold, at least \p apart samples from a better one.
std::vector<Line> maxima(const std::vector<double> &p, const LevelProfile &grid, double threshold, int apart)
{
  std::vector<Line> lines;
  const int n = static_cast<int>(p.size());
  for (int i = 0; i < n; ++i) {
    const auto first = p.begin() + std::max(0, i - apart), last = p.begin() + std::min(n, i + apart + 1);
    const double value = p[static_cast<std::size_t>(i)];
    if (value >= threshold && std::max_element(first, last) - p.begin() == i)
      lines.push_back(
          {grid.q_first + grid.step * i, value, static_cast<double>(grid.mean[static_cast<std::size_t>(i)])});
  }
  return lines;
}

/// A line between the two borders that is as strong as they are: then they are no neighbours, and what is between them
/// is no bark but a wall or a gap.
bool isDivided(const LevelProfile &profile, const Line &left, const Line &right)
{
  const double weaker = std::min(std::abs(left.contrast), std::abs(right.contrast));
  const double margin = 3 * profile.step;
  return std::any_of(profile.peaks.begin(), profile.peaks.end(), [&](const ProfilePeak &peak) {
    return peak.q > right.q + margin && peak.q < left.q - margin && std::abs(peak.contrast) > weaker;
  });
}
} // namespace

std::vector<LineDetection> detectLines(const Gradient &gradient, const vpImage<float> *p_background,
                                       const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                                       const std::vector<InhibitedRange> &known, const ProfileOptions &profile,
                                       const LineDetectorOptions &options)
{
  const LevelProfile lines = computeLevelProfile(gradient.signed_x, camera, wRc, profile);
  std::optional<LevelProfile> background;
  if (p_background)
    background = computeLevelProfile(*p_background, camera, wRc, profile);

  std::vector<double> p_left(lines.mean.size(), 0.0), p_right = p_left;
  for (std::size_t i = 0; i < lines.mean.size(); ++i) {
    const double q = lines.q_first + lines.step * static_cast<double>(i);
    const double foreground = background ? 1 - static_cast<double>(background->mean[i]) : 1;
    const double gate = logistic(foreground, options.foreground_a, options.foreground_b) * // Eq. 20
                        notInhibited(q, known, camera.fx, options.inhibition_px);          // Eq. 21
    const double fall = -lines.mean[i], rise = lines.mean[i];
    p_left[i] = gate * logistic(options.either_polarity ? std::abs(fall) : fall, options.border_a, options.border_b);
    p_right[i] = gate * logistic(options.either_polarity ? std::abs(rise) : rise, options.border_a, options.border_b);
  }

  const auto lefts = maxima(p_left, lines, options.threshold, 6);
  const auto rights = maxima(p_right, lines, options.threshold, 6);
  std::vector<std::pair<Line, Line>> pairs;
  for (const Line &left : lefts)
    for (const Line &right : rights) {
      const double width_px = (left.q - right.q) * camera.fx;
      const bool has_width = width_px >= options.width_min_px && width_px <= options.width_max_px;
      if (has_width && !isDivided(lines, left, right))
        pairs.emplace_back(left, right);
    }
  const auto score = [](const auto &pair) {
    return pair.first.p * pair.second.p * polarityWeight(pair.first, pair.second);
  };
  std::sort(pairs.begin(), pairs.end(), [&](const auto &a, const auto &b) { return score(a) > score(b); });
  std::vector<LineDetection> found;
  std::vector<InhibitedRange> taken;
  const double margin = 2 / camera.fx;
  for (const auto &[left, right] : pairs) {
    if (std::any_of(taken.begin(), taken.end(), [&, l = left, r = right](const InhibitedRange &range) {
          return l.q > range.q_right - margin && r.q < range.q_left + margin; // a border belongs to one trunk
        }))
      continue;
    taken.push_back({right.q, left.q});
    found.push_back({betweenBorders(lines.cRl, left.q, right.q), left.p, right.p});
  }
  return found;
}
} // namespace bole
