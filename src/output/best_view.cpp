// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/best_view.h"
#include "input/codec.h"

#include <bole/overlay.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace bole
{
void BestViews::add(int id, const vpImage<unsigned char> &image, const PinholeCamera &camera,
                    const RelativeTrunk &trunk, double tan_low, double tan_high)
{
  constexpr double kBetter = 1.2, kMargin = 0.6; // a view is copied when it is larger by this; margin in widths
  const Eigen::Vector2d last(camera.width - 1, camera.height - 1);
  Eigen::Matrix<double, 2, 4> ends;
  int column = 0;
  for (const Border border : {Border::left, Border::right}) {
    for (const double tan_elevation : {tan_low, tan_high}) {
      const Eigen::Vector3d ray = trunk.borderDirection(border, tan_elevation);
      if (!(ray.z() > 0.05))
        return;
      ends.col(column++) = camera.project(ray);
    }
    if (const Eigen::Vector2d middle = 0.5 * (ends.col(column - 2) + ends.col(column - 1));
        middle.x() < 0 || middle.x() > last.x())
      return;
  }
  const double width = 0.5 * std::abs((ends.col(2) + ends.col(3) - ends.col(0) - ends.col(1)).x());
  const double high = std::clamp(ends.row(1).minCoeff(), 0.0, last.y());
  const double low = std::clamp(ends.row(1).maxCoeff(), 0.0, last.y());
  const double area = width * (low - high);
  View &best = m_views[id];
  if (!(area > kBetter * best.area_px) || !(width > 1) || !(low - high > 1))
    return;
  const double margin = std::max(8.0, kMargin * width);
  const Eigen::Vector2d from(std::max(0.0, std::floor(ends.row(0).minCoeff() - margin)), std::floor(high));
  const Eigen::Vector2d to(std::min(last.x(), std::ceil(ends.row(0).maxCoeff() + margin)), std::ceil(low));
  const auto left = static_cast<unsigned>(from.x()), top = static_cast<unsigned>(from.y());
  best.area_px = area;
  best.crop.resize(static_cast<unsigned>(to.y()) - top + 1, static_cast<unsigned>(to.x()) - left + 1);
  for (unsigned v = 0; v < best.crop.getHeight(); ++v)
    std::copy_n(image[top + v] + left, best.crop.getWidth(), best.crop[v]);
  best.ends = ends.colwise() - from;
}

std::string BestViews::jpeg(int id) const
{
  const auto found = m_views.find(id);
  if (found == m_views.end() || found->second.area_px == 0)
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
