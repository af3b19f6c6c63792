// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How good a map of trunks is.

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
} // namespace bole
