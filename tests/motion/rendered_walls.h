// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A small textured world for the trackers: fronto-parallel walls of smooth random texture at
/// several depths, drawn for a camera pose by casting one ray a pixel.

#include <bole/camera.h>
#include <bole/pose.h>

#include <cmath>
#include <cstdint>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole::test
{
/// Value noise in 0 .. 1, smooth at the scale of 1.
inline double texture(double x, double y, unsigned seed)
{
  const auto hash = [seed](std::int64_t i, std::int64_t j) {
    std::uint64_t h = static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15ULL +
                      static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FULL + seed;
    h ^= h >> 29;
    h *= 0xBF58476D1CE4E5B9ULL;
    h ^= h >> 32;
    return double(h & 0xFFFF) / 65535.0;
  };
  const double fx = std::floor(x), fy = std::floor(y);
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double u = smooth(x - fx), v = smooth(y - fy);
  const auto i = static_cast<std::int64_t>(fx), j = static_cast<std::int64_t>(fy);
  return (1 - v) * ((1 - u) * hash(i, j) + u * hash(i + 1, j)) +
         v * ((1 - u) * hash(i, j + 1) + u * hash(i + 1, j + 1));
}

/// Walls at z = 5 (left third), 8 (right third) and 14 (behind all), seen from wMc (camera axes); rows moved to the
/// right by \p shear of their distance below the middle.
inline vpImage<unsigned char> drawWalls(const PinholeCamera &camera, const Pose &wMc, double shear = 0)
{
  vpImage<unsigned char> image(static_cast<unsigned>(camera.height), static_cast<unsigned>(camera.width));
  struct Wall
  {
    double z, from, to, grain;
  };
  const std::vector<Wall> walls{{5, -9, -0.8, 0.18}, {8, 1.5, 12, 0.3}, {14, -40, 40, 0.5}};
  for (unsigned y = 0; y < image.getHeight(); ++y) {
    for (unsigned x = 0; x < image.getWidth(); ++x) {
      const Eigen::Vector3d ray = wMc.R * camera.ray({x - shear * (y - camera.cy), double(y)});
      for (const Wall &wall : walls) {
        const double along = (wall.z - wMc.t.z()) / ray.z();
        const Eigen::Vector3d at = wMc.t + along * ray;
        if (along > 0 && at.x() >= wall.from && at.x() <= wall.to) {
          const double value = texture(at.x() / wall.grain, at.y() / wall.grain, static_cast<unsigned>(wall.z));
          image[y][x] = static_cast<unsigned char>(40 + 170 * value);
          break;
        }
      }
    }
  }
  return image;
}
} // namespace bole::test
