// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How good a map of trunks is.

#include "evaluation/trajectory_metrics.h"
#include "evaluation/visibility.h"
#include "input/truth.h"
#include <bole/trunk_record.h>

#include <array>
#include <string>
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
  return alignments[static_cast<std::size_t>(alignment)];
}

/// A confirmed trunk and the one of the truth it was matched with.
struct TrunkMatch
{
  TrunkRecord estimate;
  TruthTrunk truth;
  TrunkVisibility visibility;
  std::array<double, 4> error{}; ///< distance under each Alignment [m]
  double nees_half = 0;          ///< e^T P^-1 e / 2, first pose as gauge
  double predicted_sigma = 0;    ///< sqrt(trace P) [m], to be compared with the RMSE of the distance
  double radius_error = 0;       ///< estimate - truth [m], 0 where the truth has no radius
};

/// A trunk of the map without partner, or one of the truth that was expected and not found.
struct Unmatched
{
  int id = 0;
  int nearest_id = -1;         ///< in the other set (for a miss: any status), -1 if that is empty
  double nearest_distance = 0; ///< [m], after TrunkMetrics::matching
  bool is_duplicate = false;   ///< within the gate of a trunk of the truth that has a better partner
  TrunkRecord estimate;        ///< false positive: the trunk; miss: the nearest of the map
  TrunkVisibility visibility;  ///< of the missed trunk
};

/// Figures of a set of matches.
struct TrunkErrors
{
  std::size_t expected = 0, found = 0; ///< trunks of the truth that count for recall
  std::size_t matches = 0;
  std::array<double, 4> median{}, rmse{};  ///< of the distance under each Alignment [m]
  double nees_half = 0;                    ///< mean; near 1 when covariances are honest
  double predicted_sigma = 0;              ///< root mean square [m]
  double radius_rmse = 0, radius_bias = 0; ///< [m]
  double recall() const { return expected == 0 ? 0 : static_cast<double>(found) / static_cast<double>(expected); }
};

struct TrunkBin
{
  std::string name;
  TrunkErrors errors;
};

struct TrunkMetrics
{
  Alignment matching = Alignment::xy_yaw; ///< after which the trunks were matched
  std::size_t confirmed = 0;
  double precision = 0; ///< matched / confirmed, against all trunks of the truth, near and far
  double recall = 0;    ///< expected and matched / expected (TrunkVisibility::is_expected)
  double f1 = 0;
  double duplicates = 0; ///< share of the confirmed trunks
  TrunkErrors all;
  std::vector<TrunkBin> by_range, by_parallax;
  std::vector<TrunkMatch> matches;
  std::vector<Unmatched> false_positives, misses;
};

/// Matches the confirmed trunks of \p map one to one with \p truth (assign(), after \p matching:
/// in x, y and yaw, and in scale where the map's metre is only estimated; under kMatchGate) and
/// measures them. Misses, false positives and duplicates
/// always count. \param visibility of each trunk of \p truth.
TrunkMetrics trunkMetrics(const std::vector<TrunkRecord> &map, const std::vector<TruthTrunk> &truth,
                          const std::vector<TrunkVisibility> &visibility, const Alignments &alignments,
                          Alignment matching = Alignment::xy_yaw);
} // namespace bole
