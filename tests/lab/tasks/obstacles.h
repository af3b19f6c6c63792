// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "tasks/obstacles.h"

namespace bole::test
{
inline Obstacle obstacleAt(double x, double y, double radius = 0.15, int id = 0)
{
  Obstacle trunk;
  trunk.id = id;
  trunk.is_confirmed = true;
  trunk.xy = {x, y};
  trunk.radius = radius;
  return trunk;
}
} // namespace bole::test
