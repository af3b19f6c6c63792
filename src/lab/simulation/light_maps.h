// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Light that does not depend on the camera, computed once: irradiance over pi of ground, bark and leaves.

#include "lab/simulation/ray_scene.h"

namespace bole
{
/// A regular grid of values with bilinear look-up, clamped at its borders.
struct LightGrid
{
  float x0 = 0, y0 = 0, cells_per_m = 1;
  int columns = 0, rows = 0;
  std::vector<float> values;

  bool contains(float x, float y) const
  {
    const float u = (x - x0) * cells_per_m, v = (y - y0) * cells_per_m;
    return u >= 0 && v >= 0 && u < columns - 1 && v < rows - 1;
  }
  float at(float x, float y) const;
};

/// Irradiance of one trunk: columns round it (wrapped), rows up it.
struct BarkLight
{
  int columns = 0, rows = 0;
  float rows_per_m = 1;
  std::vector<float> values;

  /// \param turn 0 to 1 round the trunk, \param height above the foot [m].
  float at(float turn, float height) const;
};

struct LightMaps
{
  LightGrid near_ground, far_ground;
  std::vector<BarkLight> bark;
  std::vector<float> leaves; ///< one a quad
  float sun = 0,
        sky = 1; ///< irradiance over pi of a plane that faces the sun, of one that faces the sky

  LightMaps(const Forest &forest, const ForestMesh &mesh, const RayScene &scene);
};
} // namespace bole
