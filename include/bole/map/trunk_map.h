// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map of trunks and the life cycle of each: candidate, confirmed, lost, merged.
///
/// Idea: a trunk enters as a candidate and must earn its place: enough views, enough parallax, few frames in which it
/// should have been seen and was not. A trunk that is predicted in view and not found for long is lost, and comes
/// back under its id when it is found again under its prediction. Two trunks cannot stand in the same place: the one
/// with less behind it is merged into the other (paper, Section 7, which leaves duplicates in the map).

#include <bole/geometry/relative_trunk.h>
#include <bole/map/trunk_record.h>

#include <optional>
#include <vector>

namespace bole
{
struct MapOptions
{
  int confirm_observations = 10;      ///< views before a candidate may be confirmed, 2 to 1000
  double confirm_parallax = 0.05;     ///< angle between lines of sight before it may be confirmed [rad], 0 to 1
  double confirm_range_sigma = 0.10;  ///< relative standard deviation of the range at which it may be, 0.01 to 1
  double confirm_position_sigma = 0.30; ///< standard deviation of the place at which it may be [m], 0.01 to 10
  double confirm_hit_ratio = 0.75;    ///< found / should have been found, 0 to 1
  double confirm_innovation_px = 0.9; ///< rms of prediction against what was found, for a trunk that is narrow in the
                                      ///< image [px], 0.1 to 20; chance gives 1.4
  double near_range = 5.5;            ///< a trunk that came nearer must have been foreground [m], 0 to 100
  double confirm_foreground = 0.3;    ///< mean of 1 - p(background) inside it, where known, 0 to 1
  int doubt_observations = 8;         ///< views after which a candidate that does not fit is given up, 3 to 1000
  double doubt_slack = 1.3;           ///< a candidate stays while it is within this times confirm_innovation_px, 1 to 10
  int lost_misses = 8;                ///< misses in a row before a trunk is lost, 1 to 1000
  double merge_distance = 0.30;       ///< two trunks with less than this between their bark are one [m], 0 to 5
  double radius_min = 0.05;           ///< thinner is no trunk [m]
  double radius_max = 0.60;           ///< thicker is no trunk [m]

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// A trunk of the map with its history.
struct MapTrunk
{
  int id = 0;
  std::size_t smoother_id = 0;
  TrunkStatus status = TrunkStatus::candidate;
  Trunk trunk;                               ///< as the smoother has it now
  Matrix5d covariance = Matrix5d::Identity();
  int observations = 0;                      ///< summary factors
  int hits = 0, misses = 0, misses_in_a_row = 0;
  double first_seen_s = 0, last_seen_s = 0;
  std::optional<double> left_contrast, right_contrast; ///< signed, running mean
  double bearing_first = 0;                  ///< world bearing of the first view [rad]
  double bearing_low = 0, bearing_high = 0;  ///< extremes of the bearing from the first one [rad]
  double innovation2 = 0;                    ///< running mean of TrunkView::innovation2
  double foreground = 0;                     ///< mean of 1 - p(background) inside it
  int foreground_count = 0;
  double range_min_seen = 1e9;               ///< nearest it was [m]
  bool removed = false;                      ///< out of the smoother (merged, or a candidate given up)

  double parallax() const { return bearing_high - bearing_low; }
};

/// What one view of a trunk adds to its history.
struct TrunkView
{
  double time_s = 0;
  double bearing = 0; ///< of the trunk from the camera, world [rad]
  double range = 0;   ///< [m]
  double left_contrast = 0, right_contrast = 0; ///< 0: not used
  double innovation2 = 0; ///< mean square of prediction against what was found, over both borders [px^2], less the
                          ///< wider the trunk stands in the image (its borders are rougher)
};

/// What review() decided.
struct MapChange
{
  int id = 0;
  int into = -1; ///< for a merge: the trunk that stays
  TrunkStatus from = TrunkStatus::candidate, to = TrunkStatus::candidate;
};

class TrunkMap
{
public:
  explicit TrunkMap(const MapOptions &options = {});

  MapTrunk &add(std::size_t smoother_id, const Trunk &trunk);
  std::vector<MapTrunk> &trunks() { return m_trunks; }
  const std::vector<MapTrunk> &trunks() const { return m_trunks; }
  int count(TrunkStatus status) const;

  void recordView(MapTrunk &trunk, const TrunkView &view) const;
  void recordMiss(MapTrunk &trunk) const;
  /// Saliency inside a trunk \p range away; said nothing of it beyond near_range.
  void recordForeground(MapTrunk &trunk, double range, double foreground) const;

  /// Promotes, loses and merges by what is known now. The caller carries the changes to the smoother.
  std::vector<MapChange> review();

  std::vector<TrunkRecord> records() const;

private:
  bool fits(const MapTrunk &trunk, double slack = 1) const;
  bool isForeground(const MapTrunk &trunk) const;
  bool isHit(const MapTrunk &trunk, double ratio) const;
  bool isDisproved(const MapTrunk &trunk) const;
  bool mayBeConfirmed(const MapTrunk &trunk) const;
  bool isDuplicate(const MapTrunk &a, const MapTrunk &b) const;

  MapOptions m_options;
  std::vector<MapTrunk> m_trunks;
};
} // namespace bole
