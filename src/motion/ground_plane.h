// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The unit of length from the ground: points below the horizon, the direction of up, and the
/// height of the camera that somebody measured (a sonar, or the user with `--camera-height`).
///
/// Idea: a ground point at inverse depth q along the ray x lies up . x / q below the camera. For
/// flat ground all have one height; bushes and stumps stand above it, so the estimate is the lower
/// mode of the heights, robustly refined.
///
/// Laws (each a test): points on a plane give its height exactly; a third of the points on bushes
/// changes it by less than its standard deviation says; points above the horizon do not count.

#include "motion/point_odometry.h"

namespace bole
{
struct GroundHeight
{
  bool known = false;
  double height = 0; ///< of the camera over the ground [units of the points]
  double sigma = 0;  ///< [units]
};

/// \param up unit vector in the camera frame of the points.
GroundHeight heightOverGround(const std::vector<PointDepth> &points, const PinholeCamera &camera,
                              const Eigen::Vector3d &up);

/// Metres a unit from heights in units and in metres, over a flight: a robust mean of the logs.
class ScaleFromHeight
{
public:
  /// \p height_m of the camera over the ground [m], with its standard deviation.
  void add(const GroundHeight &seen, double height_m, double sigma_m);
  bool known() const { return m_logs.size() >= 3; }
  double metresPerUnit() const;
  /// Relative standard deviation; frames share their ground, so ten of them count as one, and 4 %
  /// stay (slope, tilt of up; measured on the rendered flights: errors of 2 to 8 %).
  double relativeSigma() const;

private:
  std::vector<double> m_logs, m_variances;
};
} // namespace bole
