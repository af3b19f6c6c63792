// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "input/frame_builder.h"

#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
/// The lens of the shrunk image.
CameraModel shrunk(const CameraModel &model, int max_width_px)
{
  const PinholeCamera &full = model.pinhole;
  if (max_width_px <= 0 || full.width <= max_width_px)
    return model;
  CameraModel small = model;
  PinholeCamera &pinhole = small.pinhole;
  pinhole.width = max_width_px;
  pinhole.height =
      std::max(1, static_cast<int>(std::lround(static_cast<double>(full.height) * max_width_px / full.width)));
  const double sx = static_cast<double>(pinhole.width) / full.width;
  const double sy = static_cast<double>(pinhole.height) / full.height;
  pinhole.fx = full.fx * sx;
  pinhole.fy = full.fy * sy;
  pinhole.cx = (full.cx + 0.5) * sx - 0.5;
  pinhole.cy = (full.cy + 0.5) * sy - 0.5;
  return small;
}

/// Whether every border pixel of \p output looks into the image of \p lens.
bool seesOnlyImage(const PinholeCamera &output, const CameraModel &lens)
{
  const auto inside = [&](double u, double v) {
    return lens.pinhole.contains(lens.distort(output.ray({u, v}).head<2>()));
  };
  const double right = output.width - 1, bottom = output.height - 1;
  for (int i = 0; i <= 64; ++i) {
    const double part = i / 64.0;
    if (!inside(part * right, 0) || !inside(part * right, bottom) || !inside(0, part * bottom) ||
        !inside(right, part * bottom))
      return false;
  }
  return true;
}

PinholeCamera rectifiedPinhole(const CameraModel &lens)
{
  if (lens.distortion == Distortion::none)
    return lens.pinhole;
  PinholeCamera output = lens.pinhole;
  double narrow = 2.0, wide = 0.6; // factors on the focal length
  for (int i = 0; i < 30; ++i) {
    const double factor = 0.5 * (narrow + wide);
    output.fx = factor * lens.pinhole.fx;
    output.fy = factor * lens.pinhole.fy;
    (seesOnlyImage(output, lens) ? narrow : wide) = factor;
  }
  output.fx = narrow * lens.pinhole.fx;
  output.fy = narrow * lens.pinhole.fy;
  return output;
}
} // namespace

struct Rectifier::Map
{
  int input_width = 0, input_height = 0;
  CameraModel lens; ///< of the shrunk image
  PinholeCamera output;
  cv::Mat map_xy, map_fraction;
  cv::Mat small; ///< scratch
};

Rectifier::Rectifier(const CameraModel &model, int max_width_px) : m_map(std::make_unique<Map>())
{
  Map &map = *m_map;
  map.input_width = model.pinhole.width;
  map.input_height = model.pinhole.height;
  map.lens = shrunk(model, max_width_px);
  map.output = rectifiedPinhole(map.lens);
  if (map.lens.distortion == Distortion::none)
    return;
  cv::Mat xy(map.output.height, map.output.width, CV_32FC2);
  for (int v = 0; v < xy.rows; ++v)
    for (int u = 0; u < xy.cols; ++u) {
      const Eigen::Vector2d bent = map.lens.distort(map.output.ray({u, v}).head<2>());
      xy.at<cv::Vec2f>(v, u) = {static_cast<float>(bent.x()), static_cast<float>(bent.y())};
    }
  cv::convertMaps(xy, cv::Mat(), map.map_xy, map.map_fraction, CV_16SC2);
}

Rectifier::~Rectifier() = default;
Rectifier::Rectifier(Rectifier &&) noexcept = default;
Rectifier &Rectifier::operator=(Rectifier &&) noexcept = default;

int Rectifier::inputWidth() const { return m_map->input_width; }
int Rectifier::inputHeight() const { return m_map->input_height; }
const PinholeCamera &Rectifier::camera() const { return m_map->output; }

bool Rectifier::isIdentity() const { return m_map->map_xy.empty() && m_map->output.width == m_map->input_width; }

void Rectifier::apply(vpImage<unsigned char> &image) const
{
  Map &map = *m_map;
  const int width = static_cast<int>(image.getWidth()), height = static_cast<int>(image.getHeight());
  if (width != map.input_width || height != map.input_height)
    throw dimensionError("image size = {}x{}, must be {}x{} as the camera's", width, height, map.input_width,
                         map.input_height);
  if (isIdentity())
    return;
  const cv::Size size(map.output.width, map.output.height);
  const cv::Mat full(height, width, CV_8UC1, image.bitmap);
  if (width != size.width)
    cv::resize(full, map.small, size, 0, 0, cv::INTER_AREA);
  else
    full.copyTo(map.small);
  image.resize(static_cast<unsigned>(size.height), static_cast<unsigned>(size.width));
  cv::Mat output(size, CV_8UC1, image.bitmap);
  if (map.map_xy.empty())
    map.small.copyTo(output);
  else
    cv::remap(map.small, output, map.map_xy, map.map_fraction, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
}
} // namespace bole
