// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Clouds of points seen by two cameras, for the tests of this stage.

#include "geometry/so3.h"
#include "motion/relative_pose.h"

#include <cmath>
#include <random>

namespace bole::test
{
struct CloudOptions
{
  int points = 150;
  double noise_px = 0;
  double outliers = 0;       ///< share
  double near = 2, far = 25; ///< depth in a [m]
  bool planar = false;       ///< a wall instead of a cloud
  unsigned seed = 7;
};

/// Matches of a cloud between a camera at the origin (a) and one at aMb; pixels outside of the
/// images are left out.
inline std::vector<PointMatch> cloudMatches(const PinholeCamera &camera, const Pose &aMb, const CloudOptions &options)
{
  std::mt19937 random(options.seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> noise(0, options.noise_px);
  std::vector<PointMatch> matches;
  const Pose bMa = aMb.inverse();
  while (static_cast<int>(matches.size()) < options.points) {
    const Eigen::Vector2d a(unit(random) * (camera.width - 1), unit(random) * (camera.height - 1));
    Eigen::Vector3d point = camera.ray(a);
    if (options.planar) {
      point *= options.far / (1 + 0.6 * point.x() + 0.3 * point.y()); // slanted wall
    }
    else {
      point *= 1 / (1 / options.far + unit(random) * (1 / options.near - 1 / options.far));
    }
    const Eigen::Vector3d in_b = bMa * point;
    if (in_b.z() < 0.1 || !camera.contains(camera.project(in_b)))
      continue;
    PointMatch match;
    match.a_px = a + Eigen::Vector2d(noise(random), noise(random));
    match.b_px = camera.project(in_b) + Eigen::Vector2d(noise(random), noise(random));
    if (unit(random) < options.outliers)
      match.b_px += Eigen::Vector2d(40 * (unit(random) - 0.5), 40 * (unit(random) - 0.5));
    matches.push_back(match);
  }
  return matches;
}

inline Pose typicalMotion() { return {expSo3({0.01, -0.03, 0.02}), Eigen::Vector3d(0.15, -0.03, 0.3)}; }

inline double rotationErrorDeg(const Eigen::Matrix3d &a, const Eigen::Matrix3d &b)
{
  return logSo3(a.transpose() * b).norm() * 180 / M_PI;
}
inline double directionErrorDeg(const Eigen::Vector3d &a, const Eigen::Vector3d &b)
{
  return directionMinus(a.normalized(), b.normalized()).norm() * 180 / M_PI;
}
} // namespace bole::test
