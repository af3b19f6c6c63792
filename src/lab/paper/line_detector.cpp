// SPDX-License-Identifier: GPL-2.0-or-later
#include "paper/paper_mapper.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace bole::paper
{
namespace
{
constexpr double kFocal_px = 200; ///< what lengths in the image are held for

/// Mean of \p image along the plane through the camera's centre with the normal \p cn; 0 where less than the part
/// \p least of the image's rows shows it.
double meanAlong(const vpImage<float> &image, const PinholeCamera &camera, const Eigen::Vector3d &cn, double least)
{
  const double slope = -camera.fx * cn.y() / (camera.fy * cn.x());
  if (!(std::abs(slope) < 1))
    return 0;
  const double x = camera.cx - camera.fx / cn.x() * (cn.z() - cn.y() * camera.cy / camera.fy);
  double sum = 0;
  int rows = 0;
  for (int v = 1; v <= camera.height - 2; ++v) {
    const double u = x + slope * v;
    if (!(u >= 1 && u <= camera.width - 2))
      continue;
    const int column = static_cast<int>(u);
    const float *at = image[v] + column;
    sum += at[0] + (u - column) * static_cast<double>(at[1] - at[0]);
    ++rows;
  }
  return rows >= least * camera.height ? sum / rows : 0;
}

/// Eq. 21; distances in the image from the column to the nearest bark.
double notInhibited(double q, const std::vector<TakenRange> &known, const PinholeCamera &camera)
{
  double sum = 0;
  for (const TakenRange &tree : known) {
    const double d = camera.fx * std::max({0.0, q - tree.q_high, tree.q_low - q}) / inhibition_px(camera);
    sum += std::exp(-0.5 * d * d);
  }
  return 1 - std::min(1.0, sum);
}

struct Line
{
  double q, p;
};

/// Local maxima of the probability above the threshold, at least 3 px from a better one.
std::vector<Line> maximaOf(const std::vector<double> &p, const LevelProfile &grid)
{
  constexpr int kApart = 6; // samples
  std::vector<Line> lines;
  const int n = static_cast<int>(p.size());
  for (int i = 0; i < n; ++i) {
    const auto first = p.begin() + std::max(0, i - kApart), last = p.begin() + std::min(n, i + kApart + 1);
    const double value = p[static_cast<std::size_t>(i)];
    if (value >= kThreshold && std::max_element(first, last) - p.begin() == i)
      lines.push_back({grid.q_first + grid.step * i, value});
  }
  return lines;
}
} // namespace

double probabilityOf(double value, double quartile)
{
  constexpr double kNineTenths = 1.2; // of the quartile: the median of the borders of near trunks, in park-forward
  const double a = -std::log(9.0) / ((kNineTenths - 1) * quartile);
  return 1 / (1 + std::exp(a * (value - quartile)));
}

double inhibition_px(const PinholeCamera &camera) { return 6 * camera.fx / kFocal_px; }

LevelProfile::LevelProfile(const vpImage<float> &image, const PinholeCamera &camera, const Eigen::Matrix3d &wRc)
{
  constexpr double kLeast = 0.4; // of the rows: a shorter line says little
  const double heading = std::atan2(wRc(1, 2), wRc(0, 2));
  cRl = wRc.transpose() * Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  step = 0.5 / camera.fx;
  const int half = static_cast<int>(1.15 * std::max(camera.cx, camera.width - camera.cx) / camera.fx / step);
  q_first = -half * step;
  for (int i = -half; i <= half; ++i)
    mean.push_back(meanAlong(image, camera, cRl * Eigen::Vector3d(i * step, -1, 0).normalized(), kLeast));
}

std::vector<NewTree> detectTrees(const SplitGradient &gradient, const vpImage<float> &p_background,
                                 const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                                 const std::vector<TakenRange> &known, const LineQuartiles &quartiles)
{
  const LevelProfile falling(gradient.negative, camera, wRc), rising(gradient.positive, camera, wRc);
  const LevelProfile background(p_background, camera, wRc);
  std::vector<double> p_left, p_right;
  for (std::size_t i = 0; i < falling.mean.size(); ++i) {
    const double q = falling.q_first + falling.step * static_cast<double>(i);
    const double gate = probabilityOf(1 - background.mean[i], quartiles.foreground) * // Eq. 20
                        notInhibited(q, known, camera);
    p_left.push_back(gate * probabilityOf(-falling.mean[i], quartiles.gradient)); // Eq. 19
    p_right.push_back(gate * probabilityOf(rising.mean[i], quartiles.gradient));
  }
  const double narrowest_px = 6 * camera.fx / kFocal_px, widest_px = 90 * camera.fx / kFocal_px;
  std::vector<std::pair<Line, Line>> pairs;
  for (const Line &left : maximaOf(p_left, falling))
    for (const Line &right : maximaOf(p_right, rising))
      if (const double width_px = (left.q - right.q) * camera.fx; width_px >= narrowest_px && width_px <= widest_px)
        pairs.emplace_back(left, right);
  std::sort(pairs.begin(), pairs.end(),
            [](const auto &a, const auto &b) { return a.first.p * a.second.p > b.first.p * b.second.p; });
  std::vector<NewTree> found;
  std::vector<TakenRange> taken;
  for (const auto &[left, right] : pairs) {
    const auto isIn = [l = left.q, r = right.q](const TakenRange &other) {
      return l > other.q_low && r < other.q_high;
    };
    if (std::any_of(taken.begin(), taken.end(), isIn)) // a border belongs to one tree
      continue;
    taken.push_back({right.q, left.q});
    found.push_back({betweenBorders(falling.cRl, left.q, right.q), left.p, right.p});
  }
  return found;
}
} // namespace bole::paper
