// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The ground near the camera, which may slope: a plane through the triangulated points below the horizon.
///
/// Idea: a Kalman filter on the height under the camera and the rise along both axes. A point is one of the ground, of
/// what grows on it, up to some metres above, or a wrong match; it counts by the probability that it is the first.
///
/// Laws (each a test): on a plane of any inclination up to 15 degrees the plane is found; half of the points on bushes
/// move it by less than a decimetre; without points it stays what it was.

#include <bole/report.h>

#include <Eigen/Core>

#include <vector>

namespace bole
{
/// z = z_at + slope (xy - at), as far as it is known; farther away it goes on level.
struct GroundPlane
{
  Eigen::Vector2d at = Eigen::Vector2d::Zero(); ///< [m]
  double z = 0;                                 ///< there [m]
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();

  double heightAt(const Eigen::Vector2d &xy) const;
};

class GroundFilter
{
public:
  /// The plane under \p camera [m] after the points that it sees from there.
  const GroundPlane &add(const std::vector<TriangulatedRay> &points, const Eigen::Vector3d &camera);

private:
  void moveTo(const Eigen::Vector2d &at);
  void addPoint(const TriangulatedRay &point, const Eigen::Vector3d &camera);

  GroundPlane m_plane;
  Eigen::Matrix3d m_covariance = Eigen::Vector3d(kHeight * kHeight, kSlope *kSlope, kSlope *kSlope).asDiagonal();

  /// What is known before any point was seen: pose filters count heights from the ground, some from where they started
  /// [m]; slopes in which woods are flown [1].
  static constexpr double kHeight = 0.5, kSlope = 0.1;
};
} // namespace bole
