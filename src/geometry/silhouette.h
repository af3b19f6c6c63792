// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How wide a trunk looks, and which directions it covers: the one test of what stands behind what.

#include <bole/trunk.h>

#include <limits>

namespace bole
{
/// Half of the angle [rad] that a trunk of radius \p radius_m fills, seen from \p distance_m off its axis: asin(r/d),
/// with r/d held at 0.99 for a viewpoint that touches the trunk.
double silhouetteHalfWidth(double radius_m, double distance_m);

/// The directions that a trunk covers. What is farther away along such a direction is hidden.
///
/// Law (a test): the limits of the covered bearings are +-(silhouetteHalfWidth() + margin).
class Silhouette
{
public:
  /// \p margin_rad widens the silhouette on both sides (a negative one narrows it); the tangents of elevation in the
  /// trunk frame bound it from below and above.
  explicit Silhouette(const RelativeTrunk &trunk, double margin_rad = 0,
                      double tan_low = -std::numeric_limits<double>::infinity(),
                      double tan_high = std::numeric_limits<double>::infinity());
  /// Whether the direction \p ray (camera frame, any length) meets the trunk.
  bool covers(const Eigen::Vector3d &ray) const;

private:
  Eigen::Matrix3d m_tRc;
  double m_tan_half_width, m_tan_low, m_tan_high;
};

/// The silhouette of a trunk in the horizontal plane through the camera centre.
struct HorizontalView
{
  Eigen::Vector2d offset = Eigen::Vector2d::Zero(); ///< from the camera to the axis, world axes [m]
  double bearing = 0;                               ///< of the axis in the world [rad]
  double range = 0;                                 ///< from the camera to the axis [m]
  double half_angle = 0;                            ///< of the silhouette [rad]
};

/// A trunk that leans stands elsewhere at the height of the camera than at z = 0: 3 degrees are 6 cm at eye height.
HorizontalView horizontalView(const Pose &wMc, const Trunk &trunk);
} // namespace bole
