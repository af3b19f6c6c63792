// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Ground truth of a recorded flight. For evaluation and pictures only: no stage may read it.

#include <Eigen/Core>

#include <string>
#include <vector>

namespace bole
{
/// A trunk of the truth. Position and radius are those at breast height, 1.3 m above the ground, where forest
/// inventories measure: in the rendered forests the axes that were fitted to the depth maps pass (x, y) at 1.3 m to
/// about 6 mm, with this radius to 7 mm, and are up to 0.08 m away from it at the foot.
struct TruthTrunk
{
  int id = 0;
  Eigen::Vector2d xy = Eigen::Vector2d::Zero(); ///< [m]
  double radius = 0;                            ///< [m], 0 when not known (far trunks)
  double lean = 0;                              ///< from the vertical [rad], direction not known
};

/// Reads `trees.csv` (id, x, y, radius, lean) and, where it is there, `trees_far.csv` (id, x, y) of
/// the folder \p sequence; empty when the sequence has no `trees.csv`. Errors: vpException with
/// file:line for a row that is not what it must be or an id that comes twice.
std::vector<TruthTrunk> readTruthTrunks(const std::string &sequence);
} // namespace bole
