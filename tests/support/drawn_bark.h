// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Pictures of one trunk with bark before a wall: what moves with the trunk, and what stands behind it.

#include <bole/camera.h>
#include <bole/trunk.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <visp3/core/vpImage.h>

namespace bole::test
{
inline const PinholeCamera kCamera{200, 200, 159.5, 119.5, 320, 240};

/// Looks along world x.
inline Pose lookingAlongX(double x, double y, double z)
{
  Pose wMc;
  wMc.R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  wMc.t = {x, y, z};
  return wMc;
}

/// Smooth noise with features of one unit, in 0 to 1.
inline double smoothNoise(double u, double v, unsigned seed)
{
  const auto at = [seed](double i, double j) {
    std::minstd_rand random(1u + static_cast<unsigned>(static_cast<int>(i) * 7919 + static_cast<int>(j) * 104729) +
                            seed);
    random.discard(3);
    return double(random()) / double(std::minstd_rand::max());
  };
  const double i = std::floor(u), j = std::floor(v), a = u - i, b = v - j;
  const double x = a * a * (3 - 2 * a), y = b * b * (3 - 2 * b);
  return (1 - y) * ((1 - x) * at(i, j) + x * at(i + 1, j)) + y * ((1 - x) * at(i, j + 1) + x * at(i + 1, j + 1));
}

struct Bark
{
  double contrast = 60; ///< [grey levels]
  bool repeats = false; ///< every five pixels
};

/// The trunk before a wall 12 m away.
inline vpImage<unsigned char> drawBark(const Pose &wMc, const Trunk &trunk, const Bark &bark)
{
  vpImage<unsigned char> image(240, 320);
  for (int v = 0; v < 240; ++v)
    for (int u = 0; u < 320; ++u) {
      const Eigen::Vector3d ray = wMc.R * kCamera.ray(Eigen::Vector2d(u, v));
      const Eigen::Vector2d to = trunk.xy - wMc.t.head<2>();
      const double level2 = ray.head<2>().squaredNorm(), along = ray.head<2>().dot(to) / level2;
      const double inner = along * along - (to.squaredNorm() - trunk.radius() * trunk.radius()) / level2;
      double grey = 0;
      if (inner > 0) {
        const Eigen::Vector3d p = wMc.t + (along - std::sqrt(inner)) * ray;
        const double round = std::atan2(p.y() - trunk.xy.y(), p.x() - trunk.xy.x()) * trunk.radius();
        const double texture =
            bark.repeats ? 0.5 + 0.25 * (std::sin(2 * M_PI * round / 0.0463) + std::sin(2 * M_PI * p.z() / 0.0463))
                         : smoothNoise(round / 0.02, p.z() / 0.05, 1);
        grey = 80 + bark.contrast * texture;
      }
      else {
        const Eigen::Vector3d p = wMc.t + (12 - wMc.t.x()) / ray.x() * ray;
        grey = 60 + 120 * smoothNoise(p.y() / 0.15, p.z() / 0.15, 5);
      }
      image[static_cast<unsigned>(v)][static_cast<unsigned>(u)] = static_cast<unsigned char>(std::lround(grey));
    }
  return image;
}
} // namespace bole::test
