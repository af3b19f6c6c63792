// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Trunks drawn as flat areas of grey, near before far, their borders smooth over a pixel.

#include "detection/detector.h"
#include "detection/photo_consistency.h"
#include "geometry/so3.h"
#include "gradient/gradient.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace bole::test
{
struct DrawnTrunk
{
  double x = 0, y = 0, radius = 0.15; ///< [m]
  double grey = 40;
  double lean = 0; ///< to the left for a camera that looks along x [tan]
};

inline Trunk trunkOf(const DrawnTrunk &drawn) { return {{drawn.x, drawn.y}, std::log(drawn.radius), {0, drawn.lean}}; }

/// A camera 1.2 m above the ground that looks along x, turned by \p yaw, \p pitch (nose down) and \p roll [rad].
inline Pose lookingAhead(double x, double y, double yaw = 0, double pitch = 0, double roll = 0)
{
  const Eigen::Matrix3d forward = (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
  return {expSo3({0, 0, yaw}) * expSo3({0, pitch, 0}) * expSo3({roll, 0, 0}) * forward, {x, y, 1.2}};
}

inline vpImage<unsigned char> draw(std::vector<DrawnTrunk> trunks, const Pose &wMc, const PinholeCamera &camera,
                                   double background = 200)
{
  std::sort(trunks.begin(), trunks.end(), [&](const DrawnTrunk &a, const DrawnTrunk &b) {
    return (trunkOf(a).xy - wMc.t.head<2>()).norm() > (trunkOf(b).xy - wMc.t.head<2>()).norm();
  });
  vpImage<float> picture(static_cast<unsigned>(camera.height), static_cast<unsigned>(camera.width),
                         static_cast<float>(background));
  for (const DrawnTrunk &drawn : trunks) {
    const RelativeTrunk relative = relativeTrunk(wMc, Pose(), trunkOf(drawn));
    if (relative.cRt(2, 0) <= 0)
      continue;
    const Eigen::Vector3d left = relative.borderNormal(Border::left), right = relative.borderNormal(Border::right);
    for (int v = 0; v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u) {
        const Eigen::Vector3d ray = camera.ray(Eigen::Vector2d(u, v));
        const double inside_px = camera.fx * std::min(-left.dot(ray), -right.dot(ray));
        const auto cover = static_cast<float>(std::clamp(inside_px + 0.5, 0.0, 1.0));
        picture[v][u] += cover * (static_cast<float>(drawn.grey) - picture[v][u]);
      }
  }
  vpImage<unsigned char> image(picture.getRows(), picture.getCols());
  for (unsigned i = 0; i < image.getSize(); ++i)
    image.bitmap[i] = static_cast<unsigned char>(std::lround(picture.bitmap[i]));
  return image;
}

/// Views of a flight past drawn trunks, as the detector wants them.
struct DrawnFlight
{
  PinholeCamera camera;
  std::vector<LevelProfile> profiles;
  std::vector<Pose> poses;

  DrawnFlight(const std::vector<DrawnTrunk> &trunks, std::vector<Pose> path, const ProfileOptions &options = {})
      : poses(std::move(path))
  {
    for (const Pose &wMc : poses)
      profiles.push_back(
          computeLevelProfile(computeGradient(draw(trunks, wMc, camera)).signed_x, camera, wMc.R, options));
  }
  std::vector<DetectorView> views() const
  {
    std::vector<DetectorView> all;
    for (std::size_t i = 0; i < poses.size(); ++i)
      all.push_back({&profiles[i], poses[i]});
    return all;
  }
};

/// Sideways and forward with a little turning and rolling, \p frames poses over \p metres.
inline std::vector<Pose> sweep(int frames = 18, double metres = 0.7)
{
  std::vector<Pose> path;
  for (int i = 0; i < frames; ++i) {
    const double s = static_cast<double>(i) / std::max(1, frames - 1);
    path.push_back(lookingAhead(0.4 * metres * s, metres * (s - 0.5), 0.05 * std::sin(9 * s), 0.03 * std::cos(7 * s),
                                0.08 * std::sin(5 * s)));
  }
  return path;
}

/// Far trunks of many greys side by side: a background with texture.
inline std::vector<DrawnTrunk> wall()
{
  std::vector<DrawnTrunk> trunks;
  for (int i = -20; i <= 20; ++i)
    trunks.push_back({16, 0.6 * i, 0.3, 60.0 + (i * 73 + 2000) % 140});
  return trunks;
}

/// A facade that is 4 m ahead, a strip of which looks like \p strip.
inline std::vector<DrawnTrunk> facadeAround(const DrawnTrunk &strip)
{
  constexpr double kHalf = 0.05;
  std::vector<DrawnTrunk> all{strip};
  for (int i = -40; i <= 40; ++i)
    if (const double y = 2 * kHalf * i; std::abs(y - strip.y) > strip.radius + kHalf)
      all.push_back({strip.x, y, 1.05 * kHalf, 120.0 + (i * 73 + 4000) % 100});
  return all;
}

/// A trunk ahead with stripes of bark, those left of \p shadow [m, from its axis] in the sun.
inline std::vector<DrawnTrunk> barkOf(const DrawnTrunk &trunk, double shadow)
{
  std::vector<DrawnTrunk> all{trunk};
  constexpr double kHalf = 0.012;
  for (int i = -20; i <= 20; ++i)
    if (const double y = 2 * kHalf * i; std::abs(y) < trunk.radius - kHalf)
      all.push_back({trunk.x - std::sqrt(trunk.radius * trunk.radius - y * y), trunk.y + y, kHalf,
                     (y > shadow ? 150.0 : 40.0) + (i * 37 + 800) % 50});
  return all;
}

/// A flight past drawn trunks before the wall, as rectified column images.
struct LevelFlight
{
  std::vector<ColumnImage> images;
  std::vector<Pose> poses;

  LevelFlight(std::vector<DrawnTrunk> trunks, std::vector<Pose> path) : poses(std::move(path))
  {
    for (const DrawnTrunk &far : wall())
      trunks.push_back(far);
    for (const Pose &wMc : poses)
      images.push_back(
          computeColumnImage(draw(trunks, wMc, PinholeCamera()), PinholeCamera(), wMc.R, ElevationRange()));
  }
  std::vector<ColumnView> views() const
  {
    std::vector<ColumnView> all;
    for (std::size_t i = 0; i < poses.size(); ++i)
      all.emplace_back(images[i], poses[i]);
    return all;
  }
};
} // namespace bole::test
