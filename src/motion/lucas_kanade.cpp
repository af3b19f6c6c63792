// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/lucas_kanade.h"

#include "motion/window_loops.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
constexpr float kLeastTexture = 1e-4f;   ///< of the window, in its weakest direction, as OpenCV measures it
constexpr float kUnit = 1.f / (1 << 20); ///< of the sums of products, OpenCV's
constexpr float kSettled_px = 0.01f;     ///< a step below this is the last
constexpr float kSwinging_px = 0.01f;    ///< two steps that undo each other to this end the search half-way

GreyPlane plane(const cv::Mat &level)
{
  return {level.ptr(), static_cast<std::ptrdiff_t>(level.step[0]), level.cols, level.rows};
}

bool reaches(const GreyPlane &image, const cv::Point2f &corner)
{
  return corner.x >= -kWindow_px && corner.y >= -kWindow_px && corner.x < static_cast<float>(image.width) &&
         corner.y < static_cast<float>(image.height); // false for NaN
}

/// Least and greatest eigenvalue of the gradient moments.
std::pair<float, float> eigenvalues(const Window &window)
{
  const float xx = kUnit * window.xx, xy = kUnit * window.xy, yy = kUnit * window.yy;
  const float apart = std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy);
  return {0.5f * (xx + yy - apart), 0.5f * (xx + yy + apart)};
}

const cv::Point2f kHalf(0.5f * (kWindow_px - 1), 0.5f * (kWindow_px - 1)); // from the middle to the first pixel

/// One level: moves \p to, the first pixel of the window; false where the window has no texture, is less round than
/// \p least_roundness or leaves the image.
bool refineAt(const GreyPlane &first, const GreyPlane &second, const cv::Point2f &from, cv::Point2f &to,
              double least_roundness)
{
  constexpr int kIterations = 10; // at most
  if (!reaches(first, from))
    return false;
  Window window;
  cutWindow(first, from.x, from.y, window);
  const float xx = kUnit * window.xx, xy = kUnit * window.xy, yy = kUnit * window.yy;
  const auto [weakest, strongest] = eigenvalues(window);
  const float determinant = xx * yy - xy * xy;
  if (weakest < kLeastTexture * kWindow_px * kWindow_px || weakest < least_roundness * strongest ||
      determinant < std::numeric_limits<float>::epsilon())
    return false;
  const float inverse = 1 / determinant;
  cv::Point2f before(0, 0);
  for (int i = 0; i < kIterations; ++i) {
    if (!reaches(second, to))
      return false;
    float by_x, by_y;
    mismatch(second, to.x, to.y, window, by_x, by_y);
    by_x *= kUnit;
    by_y *= kUnit;
    const cv::Point2f step((xy * by_y - yy * by_x) * inverse, (xy * by_x - xx * by_y) * inverse);
    to += step;
    if (step.dot(step) <= kSettled_px * kSettled_px)
      break;
    if (i > 0 && std::abs(step.x + before.x) < kSwinging_px && std::abs(step.y + before.y) < kSwinging_px) {
      to -= 0.5f * step;
      break;
    }
    before = step;
  }
  return true;
}
} // namespace

void buildPyramid(const cv::Mat &image, int levels, GreyPyramid &pyramid)
{
  constexpr int kReach = kWindowReach;
  pyramid.resize(static_cast<std::size_t>(levels) + 1);
  cv::Size size = image.size();
  for (std::size_t level = 0; level < pyramid.size(); ++level) {
    cv::Mat &at = pyramid[level];
    if (at.size() == size)
      at.adjustROI(kReach, kReach, kReach, kReach); // the memory of an image before
    else
      at.create(size.height + 2 * kReach, size.width + 2 * kReach, CV_8U);
    cv::Mat inside = at(cv::Rect(kReach, kReach, size.width, size.height));
    if (level > 0)
      cv::pyrDown(pyramid[level - 1], inside, size);
    cv::copyMakeBorder(level > 0 ? inside : image, at, kReach, kReach, kReach, kReach,
                       cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED);
    at = inside;
    size = {(size.width + 1) / 2, (size.height + 1) / 2};
    if (size.width <= kReach || size.height <= kReach) // reflection would need more than there is
      pyramid.resize(level + 1);
  }
}

double roundness(const cv::Mat &image, const cv::Point2f &at)
{
  if (!reaches(plane(image), at - kHalf))
    return 0;
  Window window;
  cutWindow(plane(image), at.x - kHalf.x, at.y - kHalf.y, window);
  const auto [weakest, strongest] = eigenvalues(window);
  return strongest > 0 ? weakest / strongest : 0;
}

bool followWindow(const GreyPyramid &first, const GreyPyramid &second, const cv::Point2f &from, cv::Point2f &to,
                  int levels)
{
  const int top = std::min({levels, static_cast<int>(first.size()) - 1, static_cast<int>(second.size()) - 1});
  bool is_found = false;
  to *= std::ldexp(1.f, -top);
  for (int level = top; level >= 0; --level) {
    const std::size_t l = static_cast<std::size_t>(level);
    cv::Point2f corner = to - kHalf;
    is_found = refineAt(plane(first[l]), plane(second[l]), from * std::ldexp(1.f, -level) - kHalf, corner,
                        level == 0 ? kLeastRoundness : 0);
    to = corner + kHalf;
    if (level > 0)
      to *= 2.f;
  }
  return is_found && reaches(plane(second[0]), to - kHalf);
}
} // namespace bole
