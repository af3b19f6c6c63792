// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How good a map of trunks is, and which trunks of the truth a flight had a fair chance to map.

#include "evaluation/trajectory_metrics.h"
#include <bole/open_source.h>

#include <array>
#include <vector>

namespace bole
{
/// [m] how far, after the alignment in x, y and yaw (TrunkMetrics::matching), a trunk may be from the one of the truth
/// it stands for.
constexpr double kMatchGate = 0.5;

/// Transforms of the four alignments, by the order of the enumeration.
using Alignments = std::array<PlanarTransform, 4>;
Alignments alignAll(const std::vector<PosePair> &pairs);
inline const PlanarTransform &at(const Alignments &alignments, Alignment alignment)
{
  return alignments[indexOf(alignment)];
}

/// Matches the confirmed trunks of \p map one to one with \p truth and measures them. The matching is that of assign()
/// under kMatchGate, after \p matching: in x, y and yaw, and in scale where the scale of the map is only estimated.
/// Misses, false positives and duplicates always count. \param visibility of each trunk of \p truth.
TrunkMetrics trunkMetrics(const std::vector<TrunkRecord> &map, const std::vector<TruthTrunk> &truth,
                          const std::vector<TrunkVisibility> &visibility, const Alignments &alignments,
                          Alignment matching = Alignment::xy_yaw);

/// For each row the column it is paired with, or -1: as many pairs with cost <= \p gate as possible, and among those
/// matchings the one with the least sum of costs (Hungarian method, O(n^3)).
///
/// Laws (each a test): no column twice; as good as the best of all permutations.
std::vector<int> assign(const Eigen::MatrixXd &cost, double gate);

/// What a fair chance is: a trunk stands within 8 m of the camera, at most half of its width is hidden by nearer
/// trunks, in 8 frames or more over which its bearing changes by 3 degrees or more.
///
/// Sees every trunk of \p trunks from the true poses \p wMb of the frames.
///
/// A trunk is inside the image when both of its borders are at the height of the camera; it is
/// hidden as far as the bearings between its borders are covered by those of nearer trunks. Trunks
/// without radius (far ones) neither hide nor are expected.
std::vector<TrunkVisibility> trunkVisibility(const std::vector<TruthTrunk> &trunks, const std::vector<Pose> &wMb,
                                             const Pose &bMc, const PinholeCamera &camera);
} // namespace bole
