// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Eq. 2 and Fig. 2 of the paper: the optimum of all poses and trees by odometry, priors and summary factors, together
/// with the energies (Eq. 3 and 4) of the newest image.
///
/// Levenberg-Marquardt: the energies are expanded anew where each step leads, and a step is taken only where the sum of
/// the energies themselves and of all other factors falls. So it ends, and what it leaves is never worse than what it
/// was given; where the image has no minimum it stops at the best there is. Without that test the sum grows without
/// end where views contradict each other by more than alpha allows.
///
/// Laws (each a test): the sum never rises; where it ends no move of a pose or a tree lowers it.

#include "paper/tree_energy.h"
#include <bole/graph.h>

#include <vector>

namespace bole::paper
{
/// Moves the poses and trees of \p graph to the joint optimum. \p image: of the newest pose, or nullptr; \p observed:
/// the trees that it observes, by their place in Graph::trunks.
/// \throw vpException where the sum is no number
void optimiseJointly(Graph &graph, const TreeEnergy *image = nullptr, const std::vector<std::size_t> &observed = {});

/// Marginal covariance of each tree at the optimum, in the tangent of Trunk.
std::vector<Matrix5d> treeCovariances(const Graph &graph);
} // namespace bole::paper
