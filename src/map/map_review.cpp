// SPDX-License-Identifier: GPL-2.0-or-later
// The life cycle of trunks: which are confirmed, lost, or merged with another.
#include "map/trunk_map.h"

#include "map/constellation.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>

namespace bole
{
namespace
{
constexpr double kMostLean = 5;   ///< standard deviations of the lean of trunks: two lines that are none bend to it
constexpr double kHysteresis = 1; ///< log-odds between confirmation and rejection
} // namespace

bool TrunkMap::isRejected(const MapTrunk &trunk, bool has_ranges) const
{
  if (trunk.observations < m_options.reject_observations)
    return false;
  if (!has_ranges)
    return trunk.evenness < 0.75 * m_options.turning_evenness || trunk.contrast < 0.75 * m_options.turning_contrast;
  if (trunk.trunk.lean.norm() > kMostLean * m_options.lean_sigma)
    return true;
  if (trunk.consistency_views >= kConsistencyViews && trunk.consistency_odds < m_options.confirm_odds - kHysteresis)
    return true;
  if (trunk.status == TrunkStatus::confirmed)
    return evidence(trunk) < m_options.reject_confirmed;
  return evidence(trunk) < m_options.reject_candidate || hasBetterRival(trunk, m_options.reject_rival);
}

bool TrunkMap::mayBeConfirmed(const MapTrunk &trunk, bool has_ranges) const
{
  if (!has_ranges)
    return trunk.observations >= m_options.confirm_observations && trunk.hits >= 3 * trunk.misses &&
           trunk.evenness >= m_options.turning_evenness && trunk.contrast >= m_options.turning_contrast;
  const double r = trunk.trunk.radius();
  return trunk.observations >= m_options.confirm_observations && trunk.hits >= m_options.confirm_predicted &&
         trunk.parallax() >= m_options.confirm_parallax && r >= m_options.radius_min && r <= m_options.radius_max &&
         logOdds(trunk) >= m_options.confirm_odds;
}

double distanceBetween(const Trunk &a, const Trunk &b)
{
  return (a.axisAt(kBreastHeight) - b.axisAt(kBreastHeight)).head<2>().norm();
}

namespace
{
/// Two trunks of one place and one radius: the same hypothesis about the same lines.
bool isSameHypothesis(const Trunk &a, const Trunk &b)
{
  return distanceBetween(a, b) < 0.15 && std::abs(a.log_radius - b.log_radius) < 0.25;
}
/// A narrower hypothesis within a wider one: if both are sound, the wider is the silhouette and the narrower the edge
/// of a shadow on its bark.
bool isInside(const Trunk &narrow, const Trunk &wide)
{
  return narrow.radius() < 0.8 * wide.radius() &&
         distanceBetween(narrow, wide) + narrow.radius() < wide.radius() + 0.05;
}

/// Whether \p known may be an edge on the bark of \p wide: it lies within it, and the background was not seen beside
/// its borders.
bool mayBeEdgeOf(const MapTrunk &known, const Trunk &wide)
{
  return !known.is_silhouette && isInside(known.trunk, wide);
}

/// From the last view of the one to the first of the other [s]. Not above 0: what is seen at the same time shares its
/// views' image lines, which must not count twice.
double secondsApart(const MapTrunk &a, const MapTrunk &b)
{
  return std::max(a.first_seen_s - b.last_seen_s, b.first_seen_s - a.last_seen_s);
}

/// Whether the Mahalanobis distance of two trunks in place and radius is inside the gate. Merging two visits moves all
/// poses between them.
bool isWithinMergeGate(const MapTrunk &a, const MapTrunk &b)
{
  constexpr double kFromItself = 0.05; // by which one trunk differs from another side, [m] and [1]
  constexpr double kGate = 14.2;       // chi square (3), three sigma
  Eigen::Vector3d apart;
  apart << (a.trunk.axisAt(kBreastHeight) - b.trunk.axisAt(kBreastHeight)).head<2>(),
      a.trunk.log_radius - b.trunk.log_radius;
  Eigen::Matrix3d S = (a.covarianceAt(kBreastHeight) + b.covarianceAt(kBreastHeight)).topLeftCorner<3, 3>();
  S.diagonal().array() += kFromItself * kFromItself;
  return apart.dot(S.inverse() * apart) < kGate;
}

void mergeHistory(MapTrunk &keep, const MapTrunk &gone)
{
  keep.left.add(gone.left);
  keep.right.add(gone.right);
  if (gone.last_seen_s > keep.last_seen_s) {
    keep.misses_in_a_row = gone.misses_in_a_row;
    keep.left_contrast = gone.left_contrast;
    keep.right_contrast = gone.right_contrast;
    keep.seen_from = gone.seen_from;
  }
  keep.first_seen_s = std::min(keep.first_seen_s, gone.first_seen_s);
  keep.last_seen_s = std::max(keep.last_seen_s, gone.last_seen_s);
  keep.observations += gone.observations;
  keep.hits += gone.hits;
  keep.misses += gone.misses;
}
} // namespace

bool TrunkMap::associate(const Trunk &found)
{
  bool is_known = false;
  for (const std::size_t i : m_active) {
    MapTrunk &known = m_trunks[i];
    if (known.status == TrunkStatus::lost)
      continue;
    if (isSameHypothesis(known.trunk, found)) {
      ++known.redetections;
      is_known = true;
    }
    else if (known.status == TrunkStatus::confirmed && !mayBeEdgeOf(known, found))
      is_known = is_known || areTooNear(known.trunk, found);
  }
  return is_known;
}

/// Whether there is less than MapOptions::merge_distance between the bark of two trunks: one of them is none.
bool TrunkMap::areTooNear(const Trunk &a, const Trunk &b) const
{
  return distanceBetween(a, b) < a.radius() + b.radius() + m_options.merge_distance;
}

/// Log-odds of \p trunk less those of \p rival, another hypothesis for the same place, with a bonus for the wider of
/// two that lie one within the other.
double TrunkMap::logOddsGain(const MapTrunk &trunk, const MapTrunk &rival) const
{
  constexpr double kSilhouette = 1; // log-odds that go to the wider of two sound hypotheses
  double gain = evidence(trunk) - evidence(rival);
  if (isInside(rival.trunk, trunk.trunk))
    gain += kSilhouette;
  else if (isInside(trunk.trunk, rival.trunk))
    gain -= kSilhouette;
  return gain;
}

/// Whether the log-odds of another candidate for the same place are better by more than \p margin.
bool TrunkMap::hasBetterRival(const MapTrunk &trunk, double margin) const
{
  return std::any_of(m_active.begin(), m_active.end(), [&](std::size_t i) {
    const MapTrunk &rival = m_trunks[i];
    return rival.id != trunk.id && !rival.removed && rival.status == TrunkStatus::candidate &&
           rival.observations >= m_options.reject_observations && areTooNear(trunk.trunk, rival.trunk) &&
           (margin > 0 || logOdds(rival) >= m_options.confirm_odds) && logOddsGain(rival, trunk) > margin;
  });
}

/// Which of two trunks in one place is to go; nullptr while hypotheses compete.
MapTrunk *TrunkMap::chooseRedundant(MapTrunk &a, MapTrunk &b) const
{
  if (!areTooNear(a.trunk, b.trunk))
    return nullptr;
  const bool is_a_candidate = a.status == TrunkStatus::candidate, is_b_candidate = b.status == TrunkStatus::candidate;
  if (is_a_candidate != is_b_candidate) {
    MapTrunk &candidate = is_a_candidate ? a : b, &known = is_a_candidate ? b : a;
    return mayBeEdgeOf(known, candidate.trunk) ? nullptr : &candidate; // known may be an edge on the candidate's bark
  }
  if (!is_a_candidate || isSameHypothesis(a.trunk, b.trunk))
    return logOddsGain(a, b) >= 0 ? &b : &a;
  return nullptr;
}

namespace
{
void change(MapUpdate &update, MapTrunk &trunk, TrunkStatus to, RejectReason reason, int into = -1)
{
  update.changes.push_back({trunk.id, into, trunk.status, to});
  trunk.status = to;
  trunk.reject_reason = reason;
}

void remove(MapUpdate &update, MapTrunk &trunk, RejectReason reason)
{
  trunk.removed = true;
  update.removed.push_back(trunk.smoother_id);
  change(update, trunk, TrunkStatus::lost, reason);
}
} // namespace

void TrunkMap::updateStatuses(MapUpdate &update, bool has_ranges)
{
  for (const std::size_t i : m_active) {
    MapTrunk &trunk = m_trunks[i];
    const bool is_candidate = trunk.status == TrunkStatus::candidate;
    if (is_candidate && mayBeConfirmed(trunk, has_ranges) && !hasBetterRival(trunk, 0))
      change(update, trunk, TrunkStatus::confirmed, RejectReason::none);
    else if (trunk.status == TrunkStatus::lost && trunk.misses_in_a_row == 0)
      change(update, trunk, TrunkStatus::confirmed, RejectReason::none);
    else if (trunk.status == TrunkStatus::lost)
      continue;
    else if (isRejected(trunk, has_ranges)) {
      const bool is_outdone = has_ranges && is_candidate && evidence(trunk) >= m_options.reject_candidate &&
                              hasBetterRival(trunk, m_options.reject_rival);
      remove(update, trunk, is_outdone ? RejectReason::outdone : RejectReason::doubted);
    }
    else if (trunk.misses_in_a_row >= m_options.lost_misses && is_candidate)
      remove(update, trunk, RejectReason::missed);
    else if (trunk.misses_in_a_row >= m_options.lost_misses) // out of sight, and still a trunk of the map
      change(update, trunk, TrunkStatus::lost, RejectReason::none);
  }
}

void TrunkMap::mergeDuplicates(MapUpdate &update, double now_s)
{
  const bool is_over = std::isinf(now_s);
  for (const std::size_t i : m_active)
    for (const std::size_t j : m_active) {
      MapTrunk &a = m_trunks[i], &b = m_trunks[j];
      if (a.id >= b.id || a.removed || b.removed)
        continue;
      MapTrunk *gone = chooseRedundant(a, b);
      if (!gone)
        continue;
      MapTrunk &keep = gone == &a ? b : a;
      const double apart_s = secondsApart(a, b), memory_s = m_options.candidate_memory_s;
      const bool is_another_visit = apart_s > 0 && isWithinMergeGate(a, b);
      const bool is_candidate = gone->status == TrunkStatus::candidate;
      if (is_another_visit && !is_candidate) {
        mergeVisits(update, keep, *gone);
        continue;
      }
      const bool may_be_another = is_another_visit || apart_s > memory_s; // the path may have drifted since
      if (may_be_another && (is_candidate ? now_s - gone->last_seen_s <= memory_s : !is_over))
        continue; // it may still be confirmed or pass the gate of a merge
      gone->removed = true;
      change(update, *gone, TrunkStatus::merged, RejectReason::outdone, keep.id);
      update.removed.push_back(gone->smoother_id);
    }
}

void TrunkMap::mergeVisits(MapUpdate &update, MapTrunk &keep, MapTrunk &gone)
{
  gone.removed = true;
  change(update, gone, TrunkStatus::merged, RejectReason::duplicate, keep.id);
  mergeHistory(keep, gone);
  update.merged.push_back({keep.smoother_id, gone.smoother_id});
}

/// Closes loops: matches the constellation of the trunks in sight with that of trunks that were out of sight before,
/// and merges the pairs. All trunks in sight may be shifted by the drift of the path since. Runs when a trunk is
/// confirmed.
void TrunkMap::closeLoops(MapUpdate &update, double now_s)
{
  constexpr double kSight_s = 5;     // seen within them, a trunk is in sight
  constexpr double kMostTurn = 0.35; // the drift of a heading, at most [rad]
  constexpr std::size_t kLeast = 3;  // trunks that a constellation is made of
  const bool is_new = std::any_of(update.changes.begin(), update.changes.end(), [](const MapChange &change) {
    return change.from == TrunkStatus::candidate && change.to == TrunkStatus::confirmed;
  });
  if (!is_new)
    return;
  std::vector<const MapTrunk *> seen, out_of_sight;
  for (const std::size_t i : m_active) {
    const MapTrunk &trunk = m_trunks[i];
    if (!trunk.removed && trunk.status != TrunkStatus::candidate)
      (trunk.last_seen_s > now_s - kSight_s ? seen : out_of_sight).push_back(&trunk);
  }
  std::sort(seen.begin(), seen.end(),
            [](const MapTrunk *a, const MapTrunk *b) { return a->first_seen_s < b->first_seen_s; });
  std::vector<TrunkRecord> earlier;
  while (seen.size() >= kLeast && earlier.size() < kLeast) {
    earlier.clear();
    for (const MapTrunk *trunk : out_of_sight)
      if (trunk->last_seen_s < seen.front()->first_seen_s)
        earlier.push_back(recordOf(*trunk, 0, 0, kBreastHeight));
    if (earlier.size() < kLeast)
      seen.erase(seen.begin());
  }
  if (seen.size() < kLeast)
    return;
  std::vector<TrunkRecord> now;
  for (const MapTrunk *trunk : seen)
    now.push_back(recordOf(*trunk, 0, 0, kBreastHeight));
  const auto placement = placeOnMap(now, earlier);
  if (!placement || std::abs(placement->yaw) > kMostTurn)
    return;
  for (const auto &[gone, keep] : placement->matches)
    if (!at(gone).removed)
      mergeVisits(update, at(keep), at(gone));
}

/// Deactivates candidates that were not seen for MapOptions::candidate_memory_s: they are predicted no longer.
void TrunkMap::deactivate(MapUpdate &update, double now_s)
{
  for (const std::size_t i : m_active) {
    MapTrunk &trunk = m_trunks[i];
    if (trunk.removed || trunk.status != TrunkStatus::candidate ||
        now_s - trunk.last_seen_s <= m_options.candidate_memory_s)
      continue;
    trunk.inactive = true;
    if (trunk.observations == 0)
      remove(update, trunk, RejectReason::unseen);
  }
}

void TrunkMap::indexActive()
{
  m_active.clear();
  for (std::size_t i = 0; i < m_trunks.size(); ++i)
    if (!m_trunks[i].removed && !m_trunks[i].inactive)
      m_active.push_back(i);
}

MapUpdate TrunkMap::review(double now_s, bool has_ranges)
{
  MapUpdate update;
  updateStatuses(update, has_ranges);
  mergeDuplicates(update, now_s);
  closeLoops(update, now_s);
  deactivate(update, now_s);
  m_active.erase(std::remove_if(m_active.begin(), m_active.end(),
                                [this](std::size_t i) { return m_trunks[i].removed || m_trunks[i].inactive; }),
                 m_active.end());
  archive(update, now_s);
  if (!update.changes.empty())
    estimateRadii();
  return update;
}

MapUpdate TrunkMap::reviewAll(bool has_ranges)
{
  for (MapTrunk &trunk : m_trunks)
    trunk.inactive = false;
  indexActive();
  MapUpdate update;
  estimateRadii();
  updateStatuses(update, has_ranges);
  mergeDuplicates(update, std::numeric_limits<double>::infinity()); // nothing earns its place any more
  indexActive();
  return update;
}

TrunkMap TrunkMap::withTrunks(const std::vector<int> &ids) const
{
  std::vector<MapTrunk> trunks = m_trunks;
  for (MapTrunk &trunk : trunks) {
    trunk.removed = std::find(ids.begin(), ids.end(), trunk.id) == ids.end();
    trunk.inactive = false;
    trunk.status = trunk.removed ? TrunkStatus::lost : TrunkStatus::confirmed;
  }
  return {m_options, std::move(trunks)};
}

std::vector<std::size_t> TrunkMap::applyDecisions(const std::vector<TrunkDecision> &decisions)
{
  std::vector<std::size_t> forgotten;
  std::vector<bool> stays(m_trunks.size(), false);
  for (const TrunkDecision &decision : decisions)
    stays[place(decision.id)] = decision.is_trunk && !decision.found;
  for (MapTrunk &trunk : m_trunks) {
    if (stays[place(trunk.id)])
      continue;
    if (!trunk.removed)
      forgotten.push_back(trunk.smoother_id);
    trunk.removed = true;
    if (trunk.status == TrunkStatus::confirmed) {
      trunk.status = TrunkStatus::lost;
      trunk.reject_reason = RejectReason::doubted;
    }
  }
  for (const TrunkDecision &decision : decisions) {
    MapTrunk &trunk = at(decision.id);
    trunk.final_odds = decision.log_odds;
    if (!decision.is_trunk) {
      if (trunk.status == TrunkStatus::lost && decision.log_odds >= m_options.confirm_odds)
        trunk.reject_reason = RejectReason::outdone;
      continue;
    }
    if (decision.found) {
      trunk.smoother_id = decision.found->smoother_id;
      trunk.trunk = decision.found->trunk;
      trunk.covariance = decision.found->covariance;
      trunk.place_covariance = trunk.covariance.topLeftCorner<2, 2>();
      trunk.observations = 0;
      for (const TrunkView &view : decision.found->views)
        addView(trunk, view);
    }
    trunk.status = TrunkStatus::confirmed;
    trunk.reject_reason = RejectReason::none;
    trunk.removed = trunk.inactive = false;
  }
  indexActive();
  return forgotten;
}

MapUpdate TrunkMap::removeUnranged()
{
  MapUpdate update;
  for (const std::size_t i : m_active)
    remove(update, m_trunks[i], RejectReason::unranged);
  m_active.clear();
  return update;
}
} // namespace bole
