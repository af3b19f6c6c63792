// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/level_image.h"

#include <algorithm>
#include <cmath>

namespace bole
{
LevelImage::LevelImage(const vpImage<unsigned char> &image, const PinholeCamera &camera, const Pose &wMc,
                       const LevelGrid &grid)
    : m_grid(grid), m_wMc(wMc)
{
  const Eigen::Vector3d ahead = wMc.R.col(2);
  const double heading = std::atan2(ahead.y(), ahead.x());
  const double half = std::atan(1.1 * std::max(camera.cx, camera.width - 1 - camera.cx) / camera.fx);
  m_first = std::round((heading - half) / grid.column_step);
  const int columns = static_cast<int>(2 * half / grid.column_step) + 1, rows = grid.rows;
  const int samples = std::max(1, static_cast<int>(std::lround(grid.row_step * camera.fy))); // a pixel apart
  m_grey.assign(static_cast<std::size_t>(columns * rows), 0.f);
  m_spans.resize(static_cast<std::size_t>(columns));
  const Eigen::Matrix3d cRw = wMc.R.transpose();
  const int width = static_cast<int>(image.getWidth()), height = static_cast<int>(image.getHeight());
  for (int i = 0; i < columns; ++i) {
    const double bearing = bearingOf(i);
    const Eigen::Vector3d level = cRw * Eigen::Vector3d(std::cos(bearing), std::sin(bearing), 0), up = cRw.col(2);
    Span span{static_cast<std::int16_t>(rows), 0};
    for (int k = 0; k < rows; ++k) {
      float sum = 0;
      int n = 0;
      for (int s = 0; s < samples; ++s) {
        const Eigen::Vector3d ray = level + m_grid.tanOf(k + (s + 0.5) / samples - 0.5) * up;
        if (ray.z() < 0.05)
          continue;
        const Eigen::Vector2d u = camera.project(ray);
        const int x = static_cast<int>(std::floor(u.x())), y = static_cast<int>(std::floor(u.y()));
        if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= height)
          continue;
        const auto a = static_cast<float>(u.x() - x), b = static_cast<float>(u.y() - y);
        const unsigned char *top = image[static_cast<unsigned>(y)] + x,
                            *below = image[static_cast<unsigned>(y + 1)] + x;
        sum += (1 - b) * ((1 - a) * top[0] + a * top[1]) + b * ((1 - a) * below[0] + a * below[1]);
        ++n;
      }
      if (n < samples)
        continue;
      m_grey[static_cast<std::size_t>(i * rows + k)] = sum / static_cast<float>(n);
      span.begin = std::min(span.begin, static_cast<std::int16_t>(k));
      span.end = static_cast<std::int16_t>(k + 1);
    }
    m_spans[static_cast<std::size_t>(i)] = span.end > span.begin ? span : Span{0, 0};
  }
}

double LevelImage::columnOf(double bearing) const
{
  const double steps = bearing / m_grid.column_step, round = 2 * M_PI / m_grid.column_step;
  const double middle = m_first + 0.5 * columns();
  return std::remainder(steps - middle, round) + 0.5 * columns();
}
} // namespace bole
