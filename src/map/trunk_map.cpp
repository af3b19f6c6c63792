// SPDX-License-Identifier: GPL-2.0-or-later
#include "map/trunk_map.h"

#include "geometry/require_range.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
/// Out of the map, as what is no trunk or not to be told. Returns its id.
int giveUp(MapTrunk &trunk)
{
  trunk.removed = true;
  trunk.status = TrunkStatus::lost;
  return trunk.id;
}
} // namespace

void MapOptions::validate() const
{
  requireRange("map.confirm_observations", confirm_observations, 2, 1000);
  requireRange("map.confirm_predicted", confirm_predicted, 0, 1000);
  requireRange("map.confirm_parallax", confirm_parallax, 0, 1);
  requireRange("map.confirm_position_sigma", confirm_position_sigma, 0.01, 10);
  requireRange("map.confirm_evidence", confirm_evidence, -20, 20);
  requireRange("map.turning_evenness", turning_evenness, 0, 1);
  requireRange("map.turning_contrast", turning_contrast, 0, 0.5);
  requireRange("map.doubt_observations", doubt_observations, 3, 1000);
  requireRange("map.doubt_candidate", doubt_candidate, -50, 0);
  requireRange("map.doubt_confirmed", doubt_confirmed, -50, 0);
  requireRange("map.doubt_rival", doubt_rival, 0, 50);
  requireRange("map.near_range", near_range, 0, 100);
  requireRange("map.through_range", through_range, 0, 100);
  requireRange("map.innovation_unit_px", innovation_unit_px, 0.1, 20);
  requireRange("map.usual_radius", usual_radius, 0.001, 10);
  requireRange("map.lost_misses", lost_misses, 1, 1000);
  requireRange("map.candidate_memory_s", candidate_memory_s, 0.1, 1e6);
  requireRange("map.radius_min", radius_min, 0.001, 10);
  requireRange("map.radius_max", radius_max, radius_min, 10);
}

TrunkMap::TrunkMap(const MapOptions &options) : m_options(options) { m_options.validate(); }

MapTrunk &TrunkMap::add(std::size_t smoother_id, const Trunk &trunk)
{
  MapTrunk added;
  added.id = static_cast<int>(m_trunks.size());
  added.smoother_id = smoother_id;
  added.trunk = trunk;
  m_trunks.push_back(added);
  m_active.push_back(m_trunks.size() - 1);
  return m_trunks.back();
}

int TrunkMap::count(TrunkStatus status) const
{
  return static_cast<int>(std::count_if(m_trunks.begin(), m_trunks.end(),
                                        [status](const MapTrunk &trunk) { return trunk.status == status; }));
}

void TrunkMap::recordView(MapTrunk &trunk, const TrunkView &view) const
{
  if (trunk.observations == 0) {
    trunk.bearing_first = view.bearing;
    trunk.first_seen_s = view.time_s;
    trunk.last_seen_s = view.time_s;
  }
  const double turn = std::remainder(view.bearing - trunk.bearing_first, 2 * M_PI);
  trunk.bearing_low = std::min(trunk.bearing_low, turn);
  trunk.bearing_high = std::max(trunk.bearing_high, turn);
  trunk.first_seen_s = std::min(trunk.first_seen_s, view.time_s);
  trunk.last_seen_s = std::max(trunk.last_seen_s, view.time_s);
  ++trunk.observations;
  trunk.innovation2 += (view.innovation2 - trunk.innovation2) / std::min(trunk.observations, 30);
  trunk.evenness += (view.evenness - trunk.evenness) / std::min(trunk.observations, 30);
  ++trunk.hits;
  trunk.misses_in_a_row = 0;
  const auto blend = [](std::optional<double> &mean, double now) {
    if (now != 0) // one that turned over begins anew
      mean = mean && *mean * now > 0 ? 0.7 * *mean + 0.3 * now : now;
  };
  const double weaker = std::min(std::abs(view.left_contrast), std::abs(view.right_contrast));
  if (weaker > 0)
    trunk.contrast = trunk.contrast > 0 ? 0.9 * trunk.contrast + 0.1 * weaker : weaker;
  blend(trunk.left_contrast, view.left_contrast);
  blend(trunk.right_contrast, view.right_contrast);
}

void TrunkMap::recordMiss(MapTrunk &trunk) const
{
  if (trunk.status != TrunkStatus::lost) // what hides a lost trunk says nothing more against it
    ++trunk.misses;
  ++trunk.misses_in_a_row;
}

void TrunkMap::recordForeground(MapTrunk &trunk, double range, double foreground) const
{
  if (range > m_options.near_range)
    return;
  trunk.foreground += (foreground - trunk.foreground) / ++trunk.foreground_count;
}

bool TrunkMap::isDisproved(const MapTrunk &trunk, bool has_ranges) const
{
  if (trunk.observations < m_options.doubt_observations)
    return false;
  if (!has_ranges)
    return trunk.evenness < 0.75 * m_options.turning_evenness || trunk.contrast < 0.75 * m_options.turning_contrast;
  if (trunk.status == TrunkStatus::confirmed)
    return evidence(trunk) < m_options.doubt_confirmed;
  return evidence(trunk) < m_options.doubt_candidate || hasBetterRival(trunk, m_options.doubt_rival);
}

bool TrunkMap::mayBeConfirmed(const MapTrunk &trunk, bool has_ranges) const
{
  if (!has_ranges)
    return trunk.observations >= m_options.confirm_observations && trunk.hits >= 3 * trunk.misses &&
           trunk.evenness >= m_options.turning_evenness && trunk.contrast >= m_options.turning_contrast;
  const double r = trunk.trunk.radius();
  return trunk.observations >= m_options.confirm_observations && trunk.hits >= m_options.confirm_predicted &&
         trunk.parallax() >= m_options.confirm_parallax && r >= m_options.radius_min && r <= m_options.radius_max &&
         trunk.positionSigma() <= m_options.confirm_position_sigma && evidence(trunk) >= m_options.confirm_evidence;
}

namespace
{
double distanceBetween(const Trunk &a, const Trunk &b)
{
  return (a.axisAt(kBreastHeight) - b.axisAt(kBreastHeight)).head<2>().norm();
}

/// Two trunks of one place and one radius: the same reading of the same lines.
bool isSameReading(const Trunk &a, const Trunk &b)
{
  return distanceBetween(a, b) < 0.15 && std::abs(a.log_radius - b.log_radius) < 0.25;
}
/// A narrower reading within a wider one: if both are sound, the wider is the silhouette and the narrower the edge of
/// a shadow on its bark.
bool isInside(const Trunk &narrow, const Trunk &wide)
{
  return narrow.radius() < 0.8 * wide.radius() &&
         distanceBetween(narrow, wide) + narrow.radius() < wide.radius() + 0.05;
}
} // namespace

bool TrunkMap::holds(const Trunk &trunk)
{
  bool is_known = false;
  for (const std::size_t i : m_active) {
    MapTrunk &known = m_trunks[i];
    if (known.status == TrunkStatus::lost)
      continue;
    if (isSameReading(known.trunk, trunk)) {
      ++known.found_again;
      is_known = true;
    }
    else if (known.status == TrunkStatus::confirmed && !isInside(known.trunk, trunk))
      is_known = is_known || areTooNear(known.trunk, trunk);
  }
  return is_known;
}

/// Two trunks cannot stand in one place.
bool TrunkMap::areTooNear(const Trunk &a, const Trunk &b) const
{
  return distanceBetween(a, b) < a.radius() + b.radius() + m_options.merge_distance;
}

/// By how much the odds speak for \p trunk against another reading of the same place.
double TrunkMap::advantage(const MapTrunk &trunk, const MapTrunk &rival) const
{
  constexpr double kSilhouette = 1; // log odds that go to the wider of two sound readings
  double gain = evidence(trunk) - evidence(rival);
  if (isInside(rival.trunk, trunk.trunk))
    gain += kSilhouette;
  else if (isInside(trunk.trunk, rival.trunk))
    gain -= kSilhouette;
  return gain;
}

/// Another candidate for the same place has log odds better by more than \p margin.
bool TrunkMap::hasBetterRival(const MapTrunk &trunk, double margin) const
{
  return std::any_of(m_active.begin(), m_active.end(), [&](std::size_t i) {
    const MapTrunk &rival = m_trunks[i];
    return rival.id != trunk.id && !rival.removed && rival.status == TrunkStatus::candidate &&
           rival.observations >= m_options.doubt_observations && areTooNear(trunk.trunk, rival.trunk) &&
           (margin > 0 || evidence(rival) >= m_options.confirm_evidence) && advantage(rival, trunk) > margin;
  });
}

/// Which of two trunks in one place is to go; nullptr while readings compete.
MapTrunk *TrunkMap::chooseRedundant(MapTrunk &a, MapTrunk &b) const
{
  if (!areTooNear(a.trunk, b.trunk))
    return nullptr;
  const bool is_a_candidate = a.status == TrunkStatus::candidate, is_b_candidate = b.status == TrunkStatus::candidate;
  if (is_a_candidate != is_b_candidate) {
    MapTrunk &candidate = is_a_candidate ? a : b, &known = is_a_candidate ? b : a;
    return isInside(known.trunk, candidate.trunk) ? nullptr : &candidate; // what holds it may still turn out to be it
  }
  if (!is_a_candidate || isSameReading(a.trunk, b.trunk))
    return advantage(a, b) >= 0 ? &b : &a;
  return nullptr;
}

std::vector<MapChange> TrunkMap::review(bool has_ranges)
{
  std::vector<MapChange> changes;
  const auto change = [&changes](MapTrunk &trunk, TrunkStatus to, int into = -1) {
    changes.push_back({trunk.id, into, trunk.status, to});
    trunk.status = to;
  };
  for (const std::size_t i : m_active) {
    MapTrunk &trunk = m_trunks[i];
    if (trunk.status == TrunkStatus::candidate && mayBeConfirmed(trunk, has_ranges) && !hasBetterRival(trunk, 0))
      change(trunk, TrunkStatus::confirmed);
    else if (trunk.status != TrunkStatus::lost && isDisproved(trunk, has_ranges)) {
      trunk.removed = true;
      change(trunk, TrunkStatus::lost);
    }
    else if (trunk.status == TrunkStatus::lost && trunk.misses_in_a_row == 0)
      change(trunk, TrunkStatus::confirmed);
    else if (trunk.status != TrunkStatus::lost && trunk.misses_in_a_row >= m_options.lost_misses) {
      trunk.removed = trunk.status == TrunkStatus::candidate;
      change(trunk, TrunkStatus::lost);
    }
  }
  for (const std::size_t i : m_active)
    for (const std::size_t j : m_active) {
      MapTrunk &a = m_trunks[i], &b = m_trunks[j];
      if (a.id >= b.id || a.removed || b.removed)
        continue;
      if (MapTrunk *gone = chooseRedundant(a, b)) {
        gone->removed = true;
        change(*gone, TrunkStatus::merged, gone == &a ? b.id : a.id);
      }
    }
  m_active.erase(
      std::remove_if(m_active.begin(), m_active.end(), [this](std::size_t i) { return m_trunks[i].removed; }),
      m_active.end());
  return changes;
}

std::vector<int> TrunkMap::leaveBehind(double now_s)
{
  std::vector<int> removed;
  const auto is_left_behind = [&](std::size_t i) {
    MapTrunk &trunk = m_trunks[i];
    if (trunk.status != TrunkStatus::candidate || now_s - trunk.last_seen_s <= m_options.candidate_memory_s)
      return false;
    if (trunk.observations == 0)
      removed.push_back(giveUp(trunk));
    return true;
  };
  m_active.erase(std::remove_if(m_active.begin(), m_active.end(), is_left_behind), m_active.end());
  return removed;
}

std::vector<int> TrunkMap::removeAll()
{
  std::vector<int> removed;
  for (const std::size_t i : m_active)
    removed.push_back(giveUp(m_trunks[i]));
  m_active.clear();
  return removed;
}

std::vector<TrunkRecord> TrunkMap::records(double ground_z) const
{
  const double breast = ground_z + kBreastHeight;
  std::vector<TrunkRecord> records;
  for (const MapTrunk &trunk : m_trunks) {
    TrunkRecord record;
    record.id = trunk.id;
    record.xy = trunk.trunk.axisAt(breast).head<2>();
    record.radius = trunk.trunk.radius();
    record.lean = trunk.trunk.lean;
    Eigen::Matrix<double, 2, 5> J = Eigen::Matrix<double, 2, 5>::Zero(); // of the place at breast height
    J.leftCols<2>().setIdentity();
    J.rightCols<2>() = breast * Eigen::Matrix2d::Identity();
    record.covariance_xy = J * trunk.covariance * J.transpose();
    record.variance_radius = trunk.covariance(2, 2) * record.radius * record.radius;
    record.observations = trunk.observations;
    record.first_seen_s = trunk.first_seen_s;
    record.last_seen_s = trunk.last_seen_s;
    record.status = trunk.status;
    records.push_back(record);
  }
  return records;
}
} // namespace bole
