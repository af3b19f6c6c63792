// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/best_view.h"
#include "input/codec.h"

#include <bole/overlay.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
/// Returns the share of the pixels from \p low to \p high that lies in a picture whose last pixel is \p last.
double shareInside(double low, double high, double last)
{
  const double length = high - low;
  return length > 0 ? std::max(0.0, std::min(high, last) - std::max(low, 0.0)) / length : 0;
}

/// Returns how steep the border from \p high to \p low [px] is in \p image: the step over two pixels as a share of the
/// step over eight. It is near 1 in a sharp picture and a quarter in one that is blurred by three pixels.
double steepnessAlong(const vpImage<unsigned char> &image, const Eigen::Vector2d &high, const Eigen::Vector2d &low)
{
  constexpr int kNear = 1, kFar = 4, kBeside = 2;   // [px]
  constexpr double kNoise = 4, kFeatureless = 0.05; // grey levels that noise makes; the least steepness
  double near_sum = 0, far_sum = 0;
  const int last_u = static_cast<int>(image.getWidth()) - 1, last_v = static_cast<int>(image.getHeight()) - 1;
  const int top = std::max(0, static_cast<int>(std::ceil(high.y())));
  const int bottom = std::min(last_v, static_cast<int>(std::floor(low.y())));
  for (int v = top; v <= bottom; ++v) {
    const double along = (v - high.y()) / std::max(1e-6, low.y() - high.y());
    const int u = static_cast<int>(std::lround(high.x() + along * (low.x() - high.x())));
    if (u < kFar || u > last_u - kFar)
      continue;
    const unsigned char *row = image[static_cast<unsigned>(v)] + u;
    int steepest = 0; // the border may stand some pixels beside where it was measured
    for (int off = -kBeside; off <= kBeside; ++off)
      steepest = std::max(steepest, std::abs(row[off + kNear] - row[off - kNear]));
    near_sum += steepest;
    far_sum += kNoise + std::abs(row[kFar] - row[-kFar]);
  }
  return far_sum > 0 ? std::clamp(near_sum / far_sum, kFeatureless, 1.0) : kFeatureless;
}
} // namespace

void BestViews::add(int id, const vpImage<unsigned char> &image, const PinholeCamera &camera,
                    const RelativeTrunk &trunk, double tan_low, double tan_high)
{
  constexpr double kBetter = 1.2, kMargin = 0.8; // a view is copied when its score is higher by this; margin in widths
  const Eigen::Vector2d last(camera.width - 1, camera.height - 1);
  Eigen::Matrix<double, 2, 4> ends; // of the left border, low and high, then of the right one
  int column = 0;
  for (const Border border : {Border::left, Border::right}) {
    for (const double tan_elevation : {tan_low, tan_high}) {
      const Eigen::Vector3d ray = trunk.borderDirection(border, tan_elevation);
      if (!(ray.z() > 0.05))
        return;
      ends.col(column++) = camera.project(ray);
    }
    if (const double middle = 0.5 * (ends(0, column - 2) + ends(0, column - 1)); middle < 0 || middle > last.x())
      return;
  }
  const double width = 0.5 * std::abs((ends.col(2) + ends.col(3) - ends.col(0) - ends.col(1)).x());
  const double left_u = ends.row(0).minCoeff(), right_u = ends.row(0).maxCoeff();
  const double high_v = ends.row(1).minCoeff(), low_v = ends.row(1).maxCoeff();
  const double high = std::clamp(high_v, 0.0, last.y()), low = std::clamp(low_v, 0.0, last.y());
  if (!(width > 1) || !(low - high > 1))
    return;
  const double inside = shareInside(left_u, right_u, last.x()) * shareInside(high_v, low_v, last.y());
  View &best = m_views[id];
  const double size = width * (low - high) * std::pow(inside, 4); // half outside makes it a sixteenth
  if (!(size > kBetter * best.score))                             // no sharpness would make it better
    return;
  const double score =
      size * std::min(steepnessAlong(image, ends.col(1), ends.col(0)), steepnessAlong(image, ends.col(3), ends.col(2)));
  if (!(score > kBetter * best.score))
    return;
  const double beside = std::max(8.0, kMargin * width), above = 0.12 * (low - high); // of what is shown around [px]
  const Eigen::Vector2d from(std::max(0.0, std::floor(left_u - beside)), std::max(0.0, std::floor(high_v - above)));
  const Eigen::Vector2d to(std::min(last.x(), std::ceil(right_u + beside)),
                           std::min(last.y(), std::ceil(low_v + above)));
  const auto left = static_cast<unsigned>(from.x()), top = static_cast<unsigned>(from.y());
  best.score = score;
  best.crop.resize(static_cast<unsigned>(to.y()) - top + 1, static_cast<unsigned>(to.x()) - left + 1);
  for (unsigned v = 0; v < best.crop.getHeight(); ++v)
    std::copy_n(image[top + v] + left, best.crop.getWidth(), best.crop[v]);
  best.ends = ends.colwise() - from;
}

std::string BestViews::jpeg(int id) const
{
  const auto found = m_views.find(id);
  if (found == m_views.end() || found->second.score == 0)
    return {};
  const View &view = found->second;
  constexpr int kHeight = 240, kShift = 4; // [px]; fraction of OpenCV's coordinates
  const cv::Mat grey(static_cast<int>(view.crop.getHeight()), static_cast<int>(view.crop.getWidth()), CV_8UC1,
                     view.crop.bitmap);
  const double factor = std::min(double(kHeight) / grey.rows, 1.5 * kHeight / grey.cols);
  cv::Mat scaled;
  cv::resize(grey, scaled, {}, factor, factor, factor < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  vpImage<vpRGBa> picture(static_cast<unsigned>(scaled.rows), static_cast<unsigned>(scaled.cols));
  cv::Mat canvas(scaled.rows, scaled.cols, CV_8UC4, picture.bitmap);
  cv::cvtColor(scaled, canvas, cv::COLOR_GRAY2RGBA);
  const vpRGBa colour = colourOf(id);
  const auto at = [&](int column) {
    const Eigen::Vector2d u = ((view.ends.col(column).array() + 0.5) * factor - 0.5) * (1 << kShift);
    return cv::Point(static_cast<int>(std::lround(u.x())), static_cast<int>(std::lround(u.y())));
  };
  for (const int border : {0, 2})
    cv::line(canvas, at(border), at(border + 1), cv::Scalar(colour.R, colour.G, colour.B, 255), 1, cv::LINE_AA, kShift);
  return encodeJpeg(picture);
}
} // namespace bole
