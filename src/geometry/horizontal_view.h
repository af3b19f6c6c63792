// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A trunk as it stands round a camera, in the horizontal plane at the height of the camera.

#include "geometry/silhouette.h"
#include <bole/trunk.h>

#include <cmath>

namespace bole
{
/// The silhouette of a trunk in the horizontal plane through the camera centre.
struct HorizontalView
{
  Eigen::Vector2d offset = Eigen::Vector2d::Zero(); ///< from the camera to the axis, world axes [m]
  double bearing = 0;                               ///< of the axis in the world [rad]
  double range = 0;                                 ///< from the camera to the axis [m]
  double half_angle = 0;                            ///< of the silhouette [rad]
};

/// A trunk that leans stands elsewhere at the height of the camera than at z = 0: 3 degrees are 6 cm at eye height.
inline HorizontalView horizontalView(const Pose &wMc, const Trunk &trunk)
{
  HorizontalView view;
  view.offset = trunk.axisAt(wMc.t.z()).head<2>() - wMc.t.head<2>();
  view.bearing = std::atan2(view.offset.y(), view.offset.x());
  view.range = view.offset.norm();
  view.half_angle = silhouetteHalfWidth(trunk.radius(), view.range);
  return view;
}
} // namespace bole
