// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Images of cylinders drawn flat before sky and ground, borders smooth over a pixel, with sensor noise: what a
/// tracker sees when nothing but its model is there.

#include <bole/camera.h>
#include <bole/cylinder.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

namespace bole::test
{
/// A camera at \p w_position [m] that looks along world x, turned left by \p yaw and with its nose up by \p pitch.
inline Pose cameraAt(const Eigen::Vector3d &w_position, double yaw = 0, double pitch = 0)
{
  Eigen::Matrix3d bRc;
  bRc << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Eigen::AngleAxisd turn(yaw, Eigen::Vector3d::UnitZ()), tip(-pitch, Eigen::Vector3d::UnitY());
  return Pose((turn * tip).toRotationMatrix() * bRc, w_position).inverse();
}

inline Cylinder uprightTrunk(double x, double y, double radius, double height = 4)
{
  return {{x, y, 0}, {x, y, height}, radius, ""};
}

/// Five trunks ahead of a camera near the origin, none hides another.
inline std::vector<Cylinder> smallWood()
{
  return {uprightTrunk(4, 1.6, 0.15), uprightTrunk(5, -1.5, 0.2), uprightTrunk(7, 0.3, 0.15),
          uprightTrunk(9, 5.4, 0.25), uprightTrunk(8, -3.8, 0.2)};
}

inline vpImage<unsigned char> drawTrunks(const PinholeCamera &camera, const Pose &cMo,
                                         const std::vector<Cylinder> &trunks, unsigned seed = 1)
{
  std::vector<Cylinder> seen;
  for (const Cylinder &trunk : trunks)
    seen.push_back(cMo * trunk);
  const auto range = [](const Cylinder &c) { return c.radius / relativeTrunk(c).ratio(); };
  std::sort(seen.begin(), seen.end(), [&](const Cylinder &a, const Cylinder &b) { return range(a) > range(b); });
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1.5);
  vpImage<unsigned char> image(unsigned(camera.height), unsigned(camera.width));
  std::vector<RelativeTrunk> relative;
  for (const Cylinder &c : seen)
    relative.push_back(relativeTrunk(c));
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray = camera.ray(Eigen::Vector2d(u, v));
      double grey = cMo.R.col(2).dot(ray) > 0 ? 205 : 120;
      for (std::size_t k = 0; k < seen.size(); ++k) {
        const Eigen::Matrix3d &cRt = relative[k].cRt;
        const double cover = std::min({1.0, 0.5 - camera.fx * relative[k].borderNormal(Border::left).dot(ray),
                                       0.5 - camera.fx * relative[k].borderNormal(Border::right).dot(ray)});
        if (cover <= 0 || cRt.col(0).dot(ray) <= 0)
          continue;
        const double height = cRt.col(2).dot(ray) / cRt.col(0).dot(ray) * range(seen[k]);
        if (height >= cRt.col(2).dot(seen[k].foot) && height <= cRt.col(2).dot(seen[k].top))
          grey += cover * (45 - grey);
      }
      image[unsigned(v)][unsigned(u)] =
          static_cast<unsigned char>(std::lround(std::clamp(grey + noise(random), 0.0, 255.0)));
    }
  return image;
}

inline vpImage<vpRGBa> inColour(const vpImage<unsigned char> &grey)
{
  vpImage<vpRGBa> colour(grey.getHeight(), grey.getWidth());
  for (unsigned i = 0; i < grey.getSize(); ++i)
    colour.bitmap[i] = vpRGBa(grey.bitmap[i], grey.bitmap[i], grey.bitmap[i]);
  return colour;
}

/// Distance of the camera centres [m] and of the attitudes [rad].
inline double metresApart(const Pose &a, const Pose &b) { return (a.inverse().t - b.inverse().t).norm(); }
inline double radiansApart(const Pose &a, const Pose &b)
{
  return Eigen::Quaterniond(a.R).angularDistance(Eigen::Quaterniond(b.R));
}
} // namespace bole::test
