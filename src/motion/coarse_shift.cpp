// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/coarse_shift.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
constexpr int kThumbWidth = 40;
constexpr double kLeastCommon = 0.25; ///< share of the pixels that two pictures must have in common

cv::Mat thumbOf(const cv::Mat &image)
{
  const int height = std::max(4, cvRound(double(image.rows) * kThumbWidth / image.cols));
  cv::Mat thumb;
  cv::resize(image, thumb, cv::Size(kThumbWidth, height), 0, 0, cv::INTER_AREA);
  thumb.convertTo(thumb, CV_32F, 1 / 255.0);
  return thumb;
}

/// What the shift (x, y) explains.
double gainOf(const cv::Mat &first, const cv::Mat &second, int x, int y)
{
  const int left = std::max(0, -x), right = std::min(first.cols, first.cols - x);
  const int top = std::max(0, -y), bottom = std::min(first.rows, first.rows - y);
  float a = 0, b = 0, aa = 0, ab = 0, bb = 0;
  for (int v = top; v < bottom; ++v) {
    const float *p = first.ptr<float>(v), *q = second.ptr<float>(v + y) + x;
    for (int u = left; u < right; ++u) {
      a += p[u];
      b += q[u];
      aa += p[u] * p[u];
      ab += p[u] * q[u];
      bb += q[u] * q[u];
    }
  }
  const double n = double(right - left) * (bottom - top);
  const double va = aa - double(a) * a / n, vb = bb - double(b) * b / n, common = ab - double(a) * b / n;
  if (common <= 0 || va <= 0 || vb <= 0)
    return 0;
  constexpr double kMost = 0.999; // two pictures of one view differ by their noise
  return -0.5 * n * std::log(1 - std::min(kMost, common * common / (va * vb)));
}
} // namespace

Eigen::Vector2d coarseShift(const cv::Mat &first, const cv::Mat &second)
{
  const cv::Mat a = thumbOf(first), b = thumbOf(second);
  const double least = kLeastCommon * a.cols * a.rows;
  double best = 0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  for (int y = -a.rows + 1; y < a.rows; ++y)
    for (int x = -a.cols + 1; x < a.cols; ++x) {
      if (double(a.cols - std::abs(x)) * (a.rows - std::abs(y)) < least)
        continue;
      const double gain = gainOf(a, b, x, y);
      if (gain > best) {
        best = gain;
        shift = {double(x), double(y)};
      }
    }
  return shift * (double(first.cols) / a.cols);
}
} // namespace bole
