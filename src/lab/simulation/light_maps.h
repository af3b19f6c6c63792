// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Light that does not depend on the camera, computed once: irradiance over pi of ground, bark and leaves.

#include "simulation/forest_mesh.h"

namespace bole
{
/// A regular grid of values with bilinear look-up, clamped at its borders. Of the ground: x and y in the world [m]; of
/// a trunk: x from 0 to 1 round it, y its height above the foot [m].
struct LightGrid
{
  float x0 = 0, y0 = 0, columns_per_x = 1, rows_per_y = 1;
  int columns = 0, rows = 0;
  bool is_round = false; ///< the first column stands beside the last
  std::vector<float> values;

  bool contains(float x, float y) const
  {
    const float u = (x - x0) * columns_per_x, v = (y - y0) * rows_per_y;
    return u >= 0 && v >= 0 && u < columns - 1 && v < rows - 1;
  }
  float at(float x, float y) const;
};

struct LightMaps
{
  LightGrid near_ground, far_ground;
  std::vector<LightGrid> bark; ///< one a trunk, near ones first
  std::vector<float> leaves;   ///< one a quad
  float sun = 0,
        sky = 1; ///< irradiance over pi of a plane that faces the sun, of one that faces the sky

  LightMaps(const Forest &forest, const ForestMesh &mesh, const RayScene &scene);
};
} // namespace bole
