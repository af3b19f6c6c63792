// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Images made for the saliency tests: a smooth random texture seen by a turning, moving camera.

#include <bole/camera.h>
#include <bole/pose.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <visp3/core/vpImage.h>

namespace bole::support
{
/// Sum of waves: a function of the plane with slopes everywhere, 0 to 1.
class Texture
{
public:
  explicit Texture(unsigned seed, double finest_period = 6)
  {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> angle(0, 6.283), period(finest_period, 8 * finest_period);
    for (auto &wave : m_waves) {
      const double a = angle(random), k = 6.283 / period(random);
      wave = {k * std::cos(a), k * std::sin(a), angle(random)};
    }
  }
  double operator()(double x, double y) const
  {
    double sum = 0;
    for (const auto &wave : m_waves)
      sum += std::sin(wave[0] * x + wave[1] * y + wave[2]);
    return std::clamp(0.5 + 0.12 * sum, 0., 1.);
  }

private:
  std::array<std::array<double, 3>, 12> m_waves;
};

inline vpImage<unsigned char> paint(const PinholeCamera &camera, const std::function<double(int, int)> &value)
{
  vpImage<unsigned char> image(static_cast<unsigned>(camera.height), static_cast<unsigned>(camera.width));
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u)
      image[v][u] = static_cast<unsigned char>(std::lround(255 * std::clamp(value(u, v), 0., 1.)));
  return image;
}

/// A textured wall at \p wall_depth before the world's camera (z forward), and before it an upright post at depth
/// \p post_depth, \p post_width wide, its middle at x = \p post_x [m]. Without post where the width is 0.
struct WallAndPost
{
  PinholeCamera camera{200, 200, 159.5, 119.5, 320, 240};
  double wall_depth = 40, post_depth = 3, post_width = 0, post_x = 0;
  Texture wall{1}, post{2};

  bool onPost(const Pose &wMc, int u, int v) const
  {
    const Eigen::Vector3d ray = wMc.R * camera.ray({u, v});
    const double x = wMc.t.x() + ray.x() / ray.z() * (post_depth - wMc.t.z());
    return std::abs(x - post_x) < 0.5 * post_width;
  }
  vpImage<unsigned char> view(const Pose &wMc) const
  {
    return paint(camera, [&](int u, int v) {
      const Eigen::Vector3d ray = wMc.R * camera.ray({u, v});
      const bool hit = onPost(wMc, u, v);
      const double depth = hit ? post_depth : wall_depth;
      const Eigen::Vector3d p = wMc.t + ray / ray.z() * (depth - wMc.t.z());
      return (hit ? post : wall)(200 * p.x() / depth, 200 * p.y() / depth);
    });
  }
};
} // namespace bole::support
