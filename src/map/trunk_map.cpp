// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/map/trunk_map.h>

#include <algorithm>
#include <cmath>
#include <visp3/core/vpException.h>

namespace bole
{
void MapOptions::validate() const
{
  const auto require = [](const char *name, double value, double low, double high) {
    if (!(value >= low && value <= high))
      throw vpException(vpException::badValue, "%s = %g, must be in [%g, %g]", name, value, low, high);
  };
  require("map.confirm_observations", confirm_observations, 2, 1000);
  require("map.confirm_parallax", confirm_parallax, 0, 1);
  require("map.confirm_range_sigma", confirm_range_sigma, 0.01, 1);
  require("map.confirm_position_sigma", confirm_position_sigma, 0.01, 10);
  require("map.confirm_hit_ratio", confirm_hit_ratio, 0, 1);
  require("map.confirm_innovation_px", confirm_innovation_px, 0.1, 20);
  require("map.near_range", near_range, 0, 100);
  require("map.doubt_observations", doubt_observations, 3, 1000);
  require("map.confirm_foreground", confirm_foreground, 0, 1);
  require("map.doubt_slack", doubt_slack, 1, 10);
  require("map.merge_distance", merge_distance, 0, 5);
  require("map.lost_misses", lost_misses, 1, 1000);
  require("map.radius_min", radius_min, 0.001, 10);
  require("map.radius_max", radius_max, radius_min, 10);
}

TrunkMap::TrunkMap(const MapOptions &options) : m_options(options) { m_options.validate(); }

MapTrunk &TrunkMap::add(std::size_t smoother_id, const Trunk &trunk)
{
  MapTrunk added;
  added.id = static_cast<int>(m_trunks.size());
  added.smoother_id = smoother_id;
  added.trunk = trunk;
  m_trunks.push_back(added);
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
  trunk.range_min_seen = std::min(trunk.range_min_seen, view.range);
  trunk.first_seen_s = std::min(trunk.first_seen_s, view.time_s);
  trunk.last_seen_s = std::max(trunk.last_seen_s, view.time_s);
  ++trunk.observations;
  trunk.innovation2 += (view.innovation2 - trunk.innovation2) / std::min(trunk.observations, 30);
  ++trunk.hits;
  trunk.misses_in_a_row = 0;
  const auto blend = [](std::optional<double> &mean, double now) {
    if (now != 0)
      mean = mean ? 0.7 * *mean + 0.3 * now : now;
  };
  blend(trunk.left_contrast, view.left_contrast);
  blend(trunk.right_contrast, view.right_contrast);
}

void TrunkMap::recordMiss(MapTrunk &trunk) const
{
  ++trunk.misses;
  ++trunk.misses_in_a_row;
}

void TrunkMap::recordForeground(MapTrunk &trunk, double range, double foreground) const
{
  if (range > m_options.near_range)
    return;
  trunk.foreground += (foreground - trunk.foreground) / ++trunk.foreground_count;
}

/// Predictions of a trunk come true; those of a chance pair of lines miss by what the scan allows.
bool TrunkMap::fits(const MapTrunk &trunk, double slack) const
{
  return std::sqrt(trunk.innovation2) <= slack * m_options.confirm_innovation_px;
}

/// A trunk that came near must have moved like something near.
bool TrunkMap::isForeground(const MapTrunk &trunk) const
{
  return trunk.foreground_count < 3 || trunk.foreground >= m_options.confirm_foreground;
}

bool TrunkMap::isHit(const MapTrunk &trunk, double ratio) const
{
  return trunk.hits >= ratio * (trunk.hits + trunk.misses);
}

/// Of a candidate, what keeps it from ever being confirmed; of a confirmed trunk, clear signs that it is none.
bool TrunkMap::isDisproved(const MapTrunk &trunk) const
{
  if (trunk.observations < m_options.doubt_observations)
    return false;
  if (trunk.status == TrunkStatus::candidate)
    return !fits(trunk, m_options.doubt_slack) || !isForeground(trunk);
  return !fits(trunk, 2 * m_options.doubt_slack) || !isForeground(trunk) || !isHit(trunk, 0.8 * m_options.confirm_hit_ratio);
}

bool TrunkMap::mayBeConfirmed(const MapTrunk &trunk) const
{
  const double r = trunk.trunk.radius();
  const double position_sigma = std::sqrt(trunk.covariance.topLeftCorner<2, 2>().trace());
  return trunk.observations >= m_options.confirm_observations && trunk.parallax() >= m_options.confirm_parallax &&
         isHit(trunk, m_options.confirm_hit_ratio) && r >= m_options.radius_min && r <= m_options.radius_max &&
         position_sigma <= m_options.confirm_position_sigma && fits(trunk) && isForeground(trunk) &&
         std::sqrt(trunk.covariance(2, 2)) <= 2 * m_options.confirm_range_sigma;
}

bool TrunkMap::isDuplicate(const MapTrunk &a, const MapTrunk &b) const
{
  const double distance = (a.trunk.axisAt(1.3) - b.trunk.axisAt(1.3)).head<2>().norm();
  return distance < a.trunk.radius() + b.trunk.radius() + m_options.merge_distance;
}

std::vector<MapChange> TrunkMap::review()
{
  std::vector<MapChange> changes;
  const auto change = [&changes](MapTrunk &trunk, TrunkStatus to, int into = -1) {
    changes.push_back({trunk.id, into, trunk.status, to});
    trunk.status = to;
  };
  for (MapTrunk &trunk : m_trunks) {
    if (trunk.removed)
      continue;
    if (trunk.status == TrunkStatus::candidate && mayBeConfirmed(trunk))
      change(trunk, TrunkStatus::confirmed);
    else if (trunk.status != TrunkStatus::lost && isDisproved(trunk)) {
      trunk.removed = true;
      change(trunk, TrunkStatus::lost);
    }
    else if (trunk.status == TrunkStatus::lost && trunk.misses_in_a_row == 0 && mayBeConfirmed(trunk))
      change(trunk, TrunkStatus::confirmed);
    else if (trunk.status != TrunkStatus::lost && trunk.misses_in_a_row >= m_options.lost_misses) {
      trunk.removed = trunk.status == TrunkStatus::candidate;
      change(trunk, TrunkStatus::lost);
    }
  }
  for (MapTrunk &a : m_trunks)
    for (MapTrunk &b : m_trunks) {
      if (a.id >= b.id || a.removed || b.removed || !isDuplicate(a, b))
        continue;
      MapTrunk &wide = a.trunk.log_radius >= b.trunk.log_radius ? a : b;
      MapTrunk &narrow = &wide == &a ? b : a;
      // the narrower of two is an edge on the bark, unless the wider has little behind it
      const bool is_wide_kept = wide.observations >= 0.6 * narrow.observations && wide.innovation2 <= 2 * narrow.innovation2;
      MapTrunk &keep = is_wide_kept ? wide : narrow, &gone = is_wide_kept ? narrow : wide;
      gone.removed = true;
      change(gone, TrunkStatus::merged, keep.id);
    }
  return changes;
}

std::vector<TrunkRecord> TrunkMap::records() const
{
  std::vector<TrunkRecord> records;
  for (const MapTrunk &trunk : m_trunks) {
    TrunkRecord record;
    record.id = trunk.id;
    record.xy = trunk.trunk.axisAt(kBreastHeight).head<2>();
    record.radius = trunk.trunk.radius();
    record.lean = trunk.trunk.lean;
    Eigen::Matrix<double, 2, 5> J = Eigen::Matrix<double, 2, 5>::Zero(); // of the place at breast height
    J.leftCols<2>().setIdentity();
    J.rightCols<2>() = kBreastHeight * Eigen::Matrix2d::Identity();
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
