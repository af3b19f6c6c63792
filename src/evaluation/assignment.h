// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One-to-one matching of two sets of points.

#include <Eigen/Core>

#include <vector>

namespace bole
{
/// For each row the column it is paired with, or -1: as many pairs with cost <= \p gate as possible, and among those
/// matchings the one with the least sum of costs (Hungarian method, O(n^3)).
///
/// Laws (each a test): no column twice; as good as the best of all permutations.
std::vector<int> assign(const Eigen::MatrixXd &cost, double gate);
} // namespace bole
