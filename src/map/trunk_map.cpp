// SPDX-License-Identifier: GPL-2.0-or-later
#include "map/trunk_map.h"

#include <algorithm>
#include <cmath>

namespace bole
{
TrunkMap::TrunkMap(const MapOptions &options) : TrunkMap(options, {}) {}

TrunkMap::TrunkMap(const MapOptions &options, std::vector<MapTrunk> trunks)
    : m_options(options), m_trunks(std::move(trunks))
{
  for (std::size_t i = 0; i < m_trunks.size(); ++i)
    if (!m_trunks[i].removed && !m_trunks[i].inactive)
      m_active.push_back(i);
}

void TrunkMap::setOptions(const MapOptions &options) { m_options = options; }

int TrunkMap::count(TrunkStatus status) const
{
  return static_cast<int>(std::count_if(m_trunks.begin(), m_trunks.end(),
                                        [status](const MapTrunk &trunk) { return trunk.status == status; }));
}

int TrunkMap::add(const NewTrunk &found)
{
  MapTrunk trunk;
  trunk.id = static_cast<int>(m_trunks.size());
  trunk.smoother_id = found.smoother_id;
  trunk.trunk = found.trunk;
  trunk.covariance = found.covariance;
  trunk.first_seen_s = trunk.last_seen_s = found.found_s;
  for (const TrunkView &view : found.views)
    addView(trunk, view);
  trunk.hits = 0;
  trunk.innovation2 = found.innovation2;
  if (m_options.at_once) {
    trunk.status = TrunkStatus::confirmed;
    trunk.fate = TrunkFate::none;
  }
  m_active.push_back(m_trunks.size());
  m_trunks.push_back(trunk);
  return trunk.id;
}

void TrunkMap::refresh(const TrunkEstimate &estimate)
{
  MapTrunk &trunk = m_trunks[static_cast<std::size_t>(estimate.id)];
  trunk.trunk = estimate.trunk;
  if (estimate.covariance)
    trunk.covariance = *estimate.covariance;
}

void TrunkMap::end(int id)
{
  MapTrunk &trunk = m_trunks[static_cast<std::size_t>(id)];
  trunk.status = TrunkStatus::lost;
  trunk.inactive = true;
  m_active.erase(std::remove(m_active.begin(), m_active.end(), static_cast<std::size_t>(id)), m_active.end());
}

void TrunkMap::record(const Sighting &sighting)
{
  MapTrunk &trunk = m_trunks[static_cast<std::size_t>(sighting.id)];
  trunk.flipped_in_a_row = sighting.is_flipped ? trunk.flipped_in_a_row + 1 : 0;
  if (sighting.kind == Sighting::Kind::missed) {
    if (trunk.status != TrunkStatus::lost) // what hides a trunk lost from sight does not count against it
      ++trunk.misses;
    ++trunk.misses_in_a_row;
  }
  if (sighting.kind != Sighting::Kind::seen)
    return;
  addView(trunk, sighting.view);
  if (sighting.foreground && sighting.range <= m_options.near_range)
    trunk.foreground += (*sighting.foreground - trunk.foreground) / ++trunk.foreground_count;
}

void TrunkMap::record(const PointCount &points)
{
  MapTrunk &trunk = m_trunks[static_cast<std::size_t>(points.id)];
  trunk.points_on += points.on;
  trunk.points_behind += points.behind;
}

void TrunkMap::record(const ColumnOdds &odds)
{
  constexpr double kBackground = 0.25; // beside a border: as much as tells that the trunk goes on, the other way
  MapTrunk &trunk = m_trunks[static_cast<std::size_t>(odds.id)];
  trunk.column_odds = odds.log_odds;
  trunk.column_views = odds.views;
  trunk.is_silhouette |= odds.views >= kColumnViews && odds.least_beside > kBackground;
}

std::size_t TrunkMap::readAgain(int id, const NewTrunk &reading)
{
  MapTrunk &trunk = m_trunks[static_cast<std::size_t>(id)];
  const std::size_t before = trunk.smoother_id;
  trunk.smoother_id = reading.smoother_id;
  trunk.trunk = reading.trunk;
  trunk.covariance = reading.covariance;
  trunk.observations = trunk.column_views = 0;
  trunk.is_silhouette = false;
  trunk.left_contrast.reset();
  trunk.right_contrast.reset();
  const double first_seen_s = trunk.first_seen_s;
  const int hits = trunk.hits;
  for (const TrunkView &view : reading.views)
    addView(trunk, view);
  trunk.innovation2 = reading.innovation2;
  trunk.hits = hits; // frames in which it was looked for
  trunk.first_seen_s = first_seen_s;
  return before;
}

void BearingSpread::add(double bearing)
{
  const double turned = std::remainder(bearing - first, 2 * M_PI);
  low = std::min(low, turned);
  high = std::max(high, turned);
}

void BearingSpread::add(const BearingSpread &other)
{
  const double apart = std::remainder(other.first - first, 2 * M_PI);
  low = std::min(low, apart + other.low);
  high = std::max(high, apart + other.high);
}

void blendContrast(std::optional<double> &mean, double now)
{
  if (now != 0)
    mean = mean && *mean * now > 0 ? 0.7 * *mean + 0.3 * now : now;
}

void TrunkMap::addView(MapTrunk &trunk, const TrunkView &view) const
{
  constexpr int kMemory = 30; // views of the running means
  if (trunk.observations == 0) {
    trunk.left.begin(view.bearing + view.half_angle);
    trunk.right.begin(view.bearing - view.half_angle);
    trunk.first_seen_s = trunk.last_seen_s = view.time_s;
  }
  trunk.left.add(view.bearing + view.half_angle);
  trunk.right.add(view.bearing - view.half_angle);
  trunk.first_seen_s = std::min(trunk.first_seen_s, view.time_s);
  trunk.last_seen_s = std::max(trunk.last_seen_s, view.time_s);
  trunk.seen_from = view.camera;
  ++trunk.observations;
  trunk.innovation2 += (view.innovation2 - trunk.innovation2) / std::min(trunk.observations, kMemory);
  trunk.evenness += (view.evenness - trunk.evenness) / std::min(trunk.observations, kMemory);
  ++trunk.hits;
  trunk.misses_in_a_row = 0;
  const double weaker = std::min(std::abs(view.left_contrast), std::abs(view.right_contrast));
  if (weaker > 0)
    trunk.contrast = trunk.contrast > 0 ? 0.9 * trunk.contrast + 0.1 * weaker : weaker;
  blendContrast(trunk.left_contrast, view.left_contrast);
  blendContrast(trunk.right_contrast, view.right_contrast);
}

std::vector<TrunkRecord> TrunkMap::records(double breast_z) const
{
  std::vector<TrunkRecord> records;
  for (const MapTrunk &trunk : m_trunks) {
    TrunkRecord record;
    record.id = trunk.id;
    record.xy = trunk.trunk.axisAt(breast_z).head<2>();
    record.radius = trunk.trunk.radius();
    record.lean = trunk.trunk.lean;
    record.probability = 1 / (1 + std::exp(-trunk.final_odds.value_or(evidence(trunk))));
    Matrix5d J = Matrix5d::Identity(); // of the place at breast height and the radius
    J.topRightCorner<2, 2>() = breast_z * Eigen::Matrix2d::Identity();
    J(2, 2) = record.radius;
    record.covariance = J * trunk.covariance * J.transpose();
    record.observations = trunk.observations;
    record.first_seen_s = trunk.first_seen_s;
    record.last_seen_s = trunk.last_seen_s;
    const bool is_out_of_sight = trunk.status == TrunkStatus::lost && !trunk.removed;
    record.status = is_out_of_sight ? TrunkStatus::confirmed : trunk.status;
    record.fate = trunk.fate;
    records.push_back(record);
  }
  return records;
}
} // namespace bole
