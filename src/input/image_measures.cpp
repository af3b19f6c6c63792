// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/image_measures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

namespace bole
{
namespace
{
constexpr int kThumbWidth = 80;   // px: a trunk is still a column of it
constexpr int kBrightLevel = 250; // grey level

/// Rows or columns that repeat their neighbour to an eighth of a grey level a pixel.
double repeatedShare(const cv::Mat &I)
{
  int rows = 0, columns = 0;
  for (int v = 1; v < I.rows; ++v) {
    const unsigned char *row = I.ptr(v), *above = I.ptr(v - 1);
    int difference = 0;
    for (int u = 1; u < I.cols; u += 4)
      difference += std::abs(row[u] - above[u]);
    rows += difference * 8 < I.cols / 4 ? 1 : 0;
  }
  std::vector<int> differences(static_cast<std::size_t>(I.cols), 0);
  for (int v = 0; v < I.rows; v += 8) {
    const unsigned char *row = I.ptr(v);
    for (int u = 4; u < I.cols; ++u)
      differences[static_cast<std::size_t>(u)] += std::abs(row[u] - row[u - 1]);
  }
  for (int u = 4; u < I.cols; ++u)
    columns += differences[static_cast<std::size_t>(u)] * 8 < I.rows / 8 ? 1 : 0;
  return std::max(static_cast<double>(rows) / I.rows, static_cast<double>(columns) / I.cols);
}

/// Deviation, share of bright pixels and the level of 99 %.
void addLevels(const std::array<long, 256> &histogram, long n, ImageNumbers &numbers)
{
  const auto count = static_cast<double>(n);
  double sum = 0, squares = 0, below = 0;
  for (int g = 0; g < 256; ++g) {
    const auto here = static_cast<double>(histogram[static_cast<std::size_t>(g)]);
    sum += g * here;
    squares += static_cast<double>(g) * g * here;
    numbers.bright_share += g >= kBrightLevel ? here / count : 0;
    below += here;
    if (below < 0.99 * count)
      numbers.level_99 = g + 1;
  }
  if (below > 0 && static_cast<double>(histogram[0]) >= 0.99 * count)
    numbers.level_99 = 0;
  numbers.deviation = std::sqrt(std::max(0.0, squares / count - sum * sum / count / count));
}

double parabola(float left, float centre, float right)
{
  const double curvature = left - 2 * centre + right;
  return curvature < -1e-9 ? 0.5 * (left - right) / curvature : 0;
}

} // namespace

/// One pass over every fourth column, of a large image over as many pixels as of a small one: levels, differences of
/// neighbours, noise and sharpness.
ImageNumbers measureImage(const cv::Mat &I)
{
  ImageNumbers numbers;
  std::array<long, 256> histogram{};
  long n = 0, rough = 0, mixed = 0, sharp = 0;
  const int step = std::max(1, I.rows / 240), step_across = 4 * std::max(1, I.cols / 320);
  for (int v = 2, row = 2; v + 2 < I.rows; v += step, ++row) {
    const unsigned char *a = I.ptr(v - 1), *b = I.ptr(v), *c = I.ptr(v + 1);
    const unsigned char *above = I.ptr(v - 2), *below = I.ptr(v + 2);
    for (int u = 2 + row % 4; u + 2 < I.cols; u += step_across, ++n) {
      ++histogram[b[u]];
      rough += std::abs(b[u] - b[u - 1]);
      // Second difference in both directions: blind to edges, sees noise.
      mixed += std::abs(a[u - 1] - 2 * a[u] + a[u + 1] - 2 * (b[u - 1] - 2 * b[u] + b[u + 1]) + c[u - 1] - 2 * c[u] +
                        c[u + 1]);
      // Curvature over two pixels of sums of three: sees fine structure more than noise.
      const int across = (a[u - 2] + b[u - 2] + c[u - 2]) - 2 * (a[u] + b[u] + c[u]) + (a[u + 2] + b[u + 2] + c[u + 2]);
      const int down = (above[u - 1] + above[u] + above[u + 1]) - 2 * (b[u - 1] + b[u] + b[u + 1]) +
                       (below[u - 1] + below[u] + below[u + 1]);
      sharp += std::abs(across) + std::abs(down);
    }
  }
  addLevels(histogram, n, numbers);
  const auto count = static_cast<double>(n);
  const double deviation = std::max(numbers.deviation, 1e-6);
  numbers.roughness = static_cast<double>(rough) / count / deviation;
  numbers.noise = static_cast<double>(mixed) / count * std::sqrt(M_PI / 2) / 6;
  numbers.sharpness = static_cast<double>(sharp) / count / deviation;
  numbers.repeated = repeatedShare(I);
  return numbers;
}

cv::Mat thumbOf(const cv::Mat &I)
{
  constexpr int kEnough = 4; // times the thumb: what is larger is halved first, which OpenCV does by registers
  const int width = std::min(kThumbWidth, I.cols);
  cv::Mat image = I, small, thumb;
  for (; image.cols >= 2 * kEnough * width; image = std::exchange(small, {}))
    cv::resize(image, small, image.size() / 2, 0, 0, cv::INTER_AREA);
  cv::resize(image, small, {width, std::max(1, I.rows * width / I.cols)}, 0, 0, cv::INTER_AREA);
  small.convertTo(thumb, CV_32F);
  return thumb;
}

namespace
{
/// Where what \p now shows in \p inner stood \p before, searched for as far as \p reach.
ImageMatch matchInner(const cv::Mat &before, const cv::Mat &now, const cv::Rect &inner, const cv::Point &reach)
{
  const cv::Rect searched(inner.tl() - reach, inner.size() + cv::Size(2 * reach.x, 2 * reach.y));
  cv::Mat response;
  cv::matchTemplate(before(searched), now(inner), response, cv::TM_CCOEFF_NORMED);
  double value = -1;
  cv::Point at;
  cv::minMaxLoc(response, nullptr, &value, nullptr, &at);
  ImageMatch result{value, static_cast<double>(at.x - reach.x), static_cast<double>(at.y - reach.y), response, reach};
  if (at.x > 0 && at.x + 1 < response.cols)
    result.x +=
        parabola(response.at<float>(at.y, at.x - 1), static_cast<float>(value), response.at<float>(at.y, at.x + 1));
  if (at.y > 0 && at.y + 1 < response.rows)
    result.y +=
        parabola(response.at<float>(at.y - 1, at.x), static_cast<float>(value), response.at<float>(at.y + 1, at.x));
  return result;
}

cv::Point reachIn(const cv::Mat &image)
{
  const int x = static_cast<int>(kSearchShare * image.cols);
  return {x, std::min(x / 2 + 1, image.rows / 4)};
}
} // namespace

ImageMatch matchImages(const cv::Mat &before, const cv::Mat &now)
{
  const cv::Point reach = reachIn(now);
  return matchInner(before, now, {reach, cv::Point(now.cols, now.rows) - reach}, reach);
}

std::vector<ImageMatch> matchStrips(const cv::Mat &before, const cv::Mat &now)
{
  constexpr int kStrips = 3;
  const cv::Point reach = reachIn(now);
  const int width = (now.cols - 2 * reach.x) / kStrips;
  std::vector<ImageMatch> matches;
  for (int i = 0; i < kStrips; ++i)
    matches.push_back(matchInner(before, now, {reach.x + i * width, reach.y, width, now.rows - 2 * reach.y}, reach));
  return matches;
}

double ImageMatch::bestNear(double at_x, double at_y) const
{
  constexpr int kReach = 2;
  const cv::Point centre = zero + cv::Point(static_cast<int>(std::lround(at_x)), static_cast<int>(std::lround(at_y)));
  const cv::Rect around(centre.x - kReach, centre.y - kReach, 2 * kReach + 1, 2 * kReach + 1);
  const cv::Rect tried = around & cv::Rect(0, 0, correlations.cols, correlations.rows);
  double best = -1;
  if (!tried.empty())
    cv::minMaxLoc(correlations(tried), nullptr, &best);
  return best;
}

double changeBetween(const cv::Mat &a, const cv::Mat &b)
{
  cv::Scalar mean, deviation;
  cv::meanStdDev(b - a, mean, deviation); // an exposure that changes is no motion
  return deviation[0];
}
} // namespace bole
