// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/overlay.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
constexpr int kTextBar = 30; ///< rows of the line of text [px]
constexpr int kLegend = 270; ///< columns that the legend takes there [px]
const cv::Scalar kBarColour(32, 28, 24, 255), kTextColour(230, 230, 230, 255), kWarningColour(255, 170, 60, 255);

int enlargement(const PinholeCamera &camera) { return std::max(1, (640 + camera.width - 1) / camera.width); }

cv::Scalar scalarOf(const vpRGBa &colour) { return {double(colour.R), double(colour.G), double(colour.B), 255}; }

/// Returns the image enlarged and in colour (RGBA); a frame without an image becomes grey.
cv::Mat canvasOf(const vpImage<unsigned char> &image, const PinholeCamera &camera)
{
  const int factor = enlargement(camera);
  const cv::Size size(camera.width * factor, camera.height * factor);
  if (image.getSize() == 0)
    return cv::Mat(size, CV_8UC4, cv::Scalar(96, 96, 96, 255));
  const cv::Mat grey(static_cast<int>(image.getHeight()), static_cast<int>(image.getWidth()), CV_8UC1, image.bitmap);
  cv::Mat large, canvas;
  cv::resize(grey, large, size, 0, 0, factor == 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  cv::cvtColor(large, canvas, cv::COLOR_GRAY2RGBA);
  return canvas;
}

void drawText(cv::Mat &canvas, const std::string &text, cv::Point at, double size, const cv::Scalar &colour)
{
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size, cv::Scalar(0, 0, 0, 255), 3, cv::LINE_AA);
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

/// Returns the box in which the saliency is shown; it is empty where there is none or no room for it.
cv::Rect insetBox(const cv::Mat &canvas, const vpImage<float> &foreground)
{
  if (foreground.getSize() == 0)
    return {};
  const int width = canvas.cols * 27 / 100;
  const int height = static_cast<int>(static_cast<double>(width) * foreground.getHeight() / foreground.getWidth());
  const cv::Rect box(canvas.cols - width - 8, 8, width, height);
  return height <= 0 || box.br().y > canvas.rows ? cv::Rect() : box;
}

/// Returns a border as points on the canvas, from low to high; none where it is behind the camera.
std::vector<cv::Point2f> borderPoints(const TrunkInView &trunk, Border border, const PinholeCamera &camera, int factor)
{
  constexpr int kSteps = 24;
  std::vector<cv::Point2f> points;
  for (int i = 0; i <= kSteps; ++i) {
    const double tan_elevation = trunk.tan_low + (trunk.tan_high - trunk.tan_low) * i / kSteps;
    const Eigen::Vector3d direction = trunk.relative.borderDirection(border, tan_elevation);
    if (direction.z() < 0.05)
      continue;
    const Eigen::Vector2d u = (camera.project(direction).array() + 0.5) * factor - 0.5;
    if (u.cwiseAbs().maxCoeff() < 20000)
      points.emplace_back(static_cast<float>(u.x()), static_cast<float>(u.y()));
  }
  return points;
}

void drawLine(cv::Mat &canvas, const std::vector<cv::Point2f> &points, const cv::Scalar &colour, int width,
              bool is_dashed)
{
  constexpr int kShift = 4;
  const auto fixed = [](const cv::Point2f &p) {
    return cv::Point(cvRound(p.x * (1 << kShift)), cvRound(p.y * (1 << kShift)));
  };
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    if (!is_dashed || i % 2 == 0)
      cv::line(canvas, fixed(points[i]), fixed(points[i + 1]), colour, width, cv::LINE_AA, kShift);
}

void fillBetween(cv::Mat &canvas, const std::vector<cv::Point2f> &left, const std::vector<cv::Point2f> &right,
                 const cv::Scalar &colour)
{
  if (left.size() < 2 || right.size() < 2)
    return;
  const std::vector<cv::Point> corners = {left.front(), left.back(), right.back(), right.front()};
  const cv::Rect box = cv::boundingRect(corners) & cv::Rect(0, 0, canvas.cols, canvas.rows);
  if (box.empty())
    return;
  std::vector<cv::Point> in_box;
  for (const cv::Point &corner : corners)
    in_box.push_back(corner - box.tl());
  cv::Mat tinted = canvas(box).clone();
  cv::fillConvexPoly(tinted, in_box, colour, cv::LINE_AA);
  cv::addWeighted(tinted, 0.22, canvas(box), 0.78, 0, canvas(box));
}

void drawTrunk(cv::Mat &canvas, const TrunkInView &trunk, const PinholeCamera &camera, int factor)
{
  if (!trunk.relative.isFinite())
    return;
  const auto left = borderPoints(trunk, Border::left, camera, factor);
  const auto right = borderPoints(trunk, Border::right, camera, factor);
  const bool is_confirmed = trunk.status == TrunkStatus::confirmed;
  const cv::Scalar colour = scalarOf(colourOf(trunk.id));
  if (is_confirmed && trunk.is_tracked)
    fillBetween(canvas, left, right, colour);
  drawLine(canvas, left, colour, is_confirmed ? 2 : 1, !trunk.is_tracked);
  drawLine(canvas, right, colour, is_confirmed ? 2 : 1, !trunk.is_tracked);
}

std::string labelOf(const TrunkInView &trunk)
{
  if (trunk.status != TrunkStatus::confirmed)
    return fmt::format("{}", trunk.id);
  return trunk.distance > 0 ? fmt::format("{}  {:.1f} m", trunk.id, trunk.distance) : fmt::format("{}", trunk.id);
}

/// Returns the box of \p text with its lower left corner near \p at, moved until it lies within \p canvas.
cv::Rect labelBox(const std::string &text, double size, cv::Point at, const cv::Rect &canvas)
{
  const cv::Size extent = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, nullptr) + cv::Size(6, 8);
  const int x = std::clamp(at.x, canvas.x, std::max(canvas.x, canvas.br().x - extent.width));
  const int y = std::clamp(at.y - extent.height, canvas.y, std::max(canvas.y, canvas.br().y - extent.height));
  return {{x, y}, extent};
}

/// Labels stand at the feet of their trunks, or above one another where they would cover others; one that finds no free
/// row is left out. Confirmed trunks come first.
void drawLabels(cv::Mat &canvas, const Overlay &overlay, const PinholeCamera &camera, int factor)
{
  std::vector<cv::Rect> taken;
  if (overlay.foreground.getSize() > 0)
    taken.push_back(insetBox(canvas, overlay.foreground));
  const auto isFree = [&taken](const cv::Rect &box) {
    return std::none_of(taken.begin(), taken.end(), [&](const cv::Rect &other) { return (other & box).area() > 0; });
  };
  for (const bool is_confirmed : {true, false})
    for (const TrunkInView &trunk : overlay.trunks) {
      if (!trunk.relative.isFinite() || (trunk.status == TrunkStatus::confirmed) != is_confirmed)
        continue;
      const auto points = borderPoints(trunk, Border::right, camera, factor);
      if (points.empty() || points.front().x < 0 || points.front().x > static_cast<float>(canvas.cols))
        continue;
      const std::string text = labelOf(trunk);
      const double size = is_confirmed ? 0.45 : 0.36;
      cv::Rect box = labelBox(text, size, cv::Point(points.front()) + cv::Point(2, 0), {{0, 0}, canvas.size()});
      for (int row = 0; row < 12 && !isFree(box); ++row)
        box.y -= box.height;
      if (!isFree(box) || box.y < 0)
        continue;
      taken.push_back(box);
      drawText(canvas, text, {box.x + 3, box.br().y - 4}, size, scalarOf(colourOf(trunk.id)));
    }
}

/// Colours the field: 0 is dark blue, 0.5 grey, 1 orange, and what is not a number is black.
cv::Mat coloured(const vpImage<float> &field, const cv::Size &size)
{
  const cv::Mat values(static_cast<int>(field.getHeight()), static_cast<int>(field.getWidth()), CV_32FC1, field.bitmap);
  cv::Mat large;
  cv::resize(values, large, size, 0, 0, cv::INTER_LINEAR);
  cv::Mat colours(size, CV_8UC4);
  const cv::Vec3f low(20, 40, 110), middle(128, 128, 128), high(255, 150, 30);
  for (int v = 0; v < size.height; ++v)
    for (int u = 0; u < size.width; ++u) {
      const float p = large.at<float>(v, u);
      cv::Vec3f c(0, 0, 0);
      if (std::isfinite(p))
        c = p < 0.5f ? low + (middle - low) * (2 * std::max(0.f, p))
                     : middle + (high - middle) * (2 * std::min(1.f, p) - 1);
      colours.at<cv::Vec4b>(v, u) = {cv::saturate_cast<unsigned char>(c[0]), cv::saturate_cast<unsigned char>(c[1]),
                                     cv::saturate_cast<unsigned char>(c[2]), 255};
    }
  return colours;
}

void drawInset(cv::Mat &canvas, const vpImage<float> &foreground)
{
  const cv::Rect box = insetBox(canvas, foreground);
  if (box.empty())
    return;
  coloured(foreground, box.size()).copyTo(canvas(box));
  cv::rectangle(canvas, box, kTextColour, 1);
  drawText(canvas, "near", {box.x + 5, box.y + 15}, 0.4, kTextColour);
}

/// Writes at the right end of the bar what the lines mean.
void drawLegend(cv::Mat &bar)
{
  struct Entry
  {
    const char *name;
    int width;
    bool is_dashed;
  };
  constexpr int kLine = 22, kGap = 12;
  constexpr double kSize = 0.36;
  int x = bar.cols - 4, y = bar.rows / 2;
  for (const Entry &entry : {Entry{"predicted", 2, true}, Entry{"candidate", 1, false}, Entry{"trunk", 2, false}}) {
    const int width = cv::getTextSize(entry.name, cv::FONT_HERSHEY_SIMPLEX, kSize, 1, nullptr).width;
    x -= width + kGap;
    cv::putText(bar, entry.name, {x, y + 4}, cv::FONT_HERSHEY_SIMPLEX, kSize, kTextColour, 1, cv::LINE_AA);
    x -= kLine + 4;
    for (int part = 0; part < kLine; part += 6)
      cv::line(bar, {x + part, y}, {x + part + (entry.is_dashed ? 3 : 6), y}, kTextColour, entry.width, cv::LINE_AA);
  }
}

vpImage<vpRGBa> withTextBar(const cv::Mat &canvas, const std::string &text, bool is_warning, bool has_legend)
{
  vpImage<vpRGBa> picture(static_cast<unsigned>(canvas.rows + kTextBar), static_cast<unsigned>(canvas.cols));
  cv::Mat whole(canvas.rows + kTextBar, canvas.cols, CV_8UC4, picture.bitmap);
  whole.setTo(kBarColour);
  canvas.copyTo(whole.rowRange(0, canvas.rows));
  cv::putText(whole, text, {8, canvas.rows + 20}, cv::FONT_HERSHEY_SIMPLEX, 0.45,
              is_warning ? kWarningColour : kTextColour, 1, cv::LINE_AA);
  cv::Mat bar = whole.rowRange(canvas.rows, whole.rows);
  const int used = 8 + cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, 0.45, 1, nullptr).width;
  if (has_legend && used + kLegend < bar.cols)
    drawLegend(bar);
  return picture;
}
} // namespace

vpRGBa colourOf(int id)
{
  constexpr std::size_t kBright = 6; // black and the darkest do not stand out on a wood
  constexpr std::array<std::array<unsigned char, 3>, kBright> kColours = {
      {{86, 180, 233}, {230, 159, 0}, {0, 200, 146}, {240, 228, 66}, {255, 120, 30}, {224, 140, 188}}};
  const auto &c = kColours[static_cast<std::size_t>(id < 0 ? -id : id) % kBright];
  return vpRGBa(c[0], c[1], c[2], 255);
}

vpImage<vpRGBa> drawOverlay(const vpImage<unsigned char> &image, const PinholeCamera &camera, const Overlay &overlay)
{
  cv::Mat canvas = canvasOf(image, camera);
  const int factor = enlargement(camera);
  for (const TrunkInView &trunk : overlay.trunks)
    drawTrunk(canvas, trunk, camera, factor);
  drawLabels(canvas, overlay, camera, factor);
  drawInset(canvas, overlay.foreground);
  return withTextBar(canvas, overlay.text, overlay.is_warning, true);
}

vpImage<vpRGBa> drawSaliency(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                             const vpImage<float> &foreground, const std::string &text)
{
  const cv::Mat left = canvasOf(image, camera);
  cv::Mat right(left.size(), CV_8UC4, cv::Scalar(0, 0, 0, 255));
  if (foreground.getSize() > 0)
    right = coloured(foreground, left.size());
  cv::Mat both;
  cv::hconcat(left, right, both);
  return withTextBar(both, text, false, false);
}
} // namespace bole
