// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map of trunks and the life cycle of each: candidate, confirmed, lost, merged.
///
/// Idea: a trunk enters as a candidate and must earn its place: enough views, enough parallax, and log-odds to be a
/// trunk, learnt from flights with known trunks. Several hypotheses for the same lines may compete as candidates (the
/// silhouette, the edge of a shadow on the bark, a gap between two trunks). The one with the best log-odds is
/// confirmed and the others go, since two trunks cannot stand in the same place (paper, Section 7, which leaves
/// duplicates in the map). A trunk that comes back as a duplicate hands its views, once it was confirmed by itself, to
/// the one that was there before: they tie the two visits together. Where the path has drifted so far that no trunk
/// stands on its former place, those in sight are recognised by their constellation. A confirmed trunk that is
/// predicted in view and not found for long is lost from sight; it stays in the map and comes back under its id. One
/// that was out of sight while the path drifted by more than its width is not looked for at all, as its neighbour would
/// be taken for it: each visit is a trunk of its own until both are known well enough to be tied.

#include "geometry/log_normal.h"
#include <bole/trunk.h>
#include <bole/trunk_record.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

namespace bole
{
/// Of the logarithm of the median radius of a wood: poles of 5 cm and old trees of 45 cm are within 1.6 sigma.
constexpr double kSigmaOfWoods = 0.7;

/// Of the axes of two trunks at breast height [m].
double distanceBetween(const Trunk &a, const Trunk &b);

/// Height of the ground in the world at a place [m].
using GroundZ = std::function<double(const Eigen::Vector2d &)>;

/// Which hypotheses the map keeps whole; of the others it keeps a record.
enum class Memory
{
  all,       ///< they are judged again at the end of the flight
  undecided, ///< what was not given up takes part in the last review
  in_sight   ///< a candidate that is not looked for any more is given up after forget_s: the flight has no end
};

struct MapOptions
{
  Memory memory = Memory::all;
  double forget_s = 0;            ///< [s] since its last view
  int confirm_observations = 10;  ///< views before a candidate may be confirmed, 2 to 1000
  int confirm_predicted = 3;      ///< of them after it was found, where its place was predicted, 0 to 1000
  double confirm_parallax = 0.05; ///< angle between lines of sight before it may be confirmed [rad], 0 to 1
  double confirm_odds = 0;        ///< log odds (TrunkMap::logOdds) at which it is, in flight and at the end, -20 to 20;
                                  ///< higher: fewer trunks, and fewer that are none
  double most_place_sigma = 0; ///< standard deviation of the place beyond which records() has it as a candidate [m]; 0:
                               ///< none is
  double turning_evenness = 0.35;  ///< what must speak for a trunk where the camera has only turned and no parallax
                                   ///< does: how evenly its borders run along their length, 0 to 1,
  double turning_contrast = 0.008; ///< and the mean of the weaker one [full scale/px], 0 to 0.5
  int reject_observations = 8;     ///< views before a trunk may be rejected for its log-odds, 3 to 1000
  double reject_candidate = -3;    ///< log-odds below which a candidate is rejected, -50 to 0
  double reject_confirmed = -1.5;  ///< log-odds below which a confirmed trunk is rejected, -50 to 0
  double reject_rival = 1.5;       ///< log odds by which another candidate for the same place must be better for one
                                   ///< to be rejected, 0 to 50
  double through_range = 9;        ///< whether points behind a trunk are seen through it is asked nearer than this
                                   ///< [m], 0 (never) to 100
  double innovation_unit_px = 1;   ///< rms of prediction against what was found that counts as one pixel of a camera
                                   ///< with f = 200 px [px], 0.1 to 20: in proportion to the focal length
  double lean_sigma = 0.035;       ///< standard deviation of the lean of trunks [rad], 1e-5 to 0.5
  double usual_radius = 0.15;      ///< median radius of the trunks to be found [m], 0.001 to 10
  int lost_misses = 8;             ///< misses in a row before a trunk is lost, 1 to 1000
  double candidate_memory_s = 5;   ///< a candidate that was not seen for longer is no longer looked for [s], 0.1 to 1e6
  double merge_distance = 0.30;    ///< two trunks with less than this between their bark are one [m], 0 to 5
  double radius_min = 0.017;       ///< thinner is no trunk [m]
  double radius_max = 0.95;        ///< thicker is no trunk [m]
};

/// Points of the scene at a trunk.
struct PointCount
{
  int id = 0;
  int on = 0, behind = 0;            ///< inside its borders: at its range, and beyond it
  int beside = 0, behind_beside = 0; ///< just outside of them: at its range, and beyond it
};

/// Extremes of a bearing in the world.
struct BearingSpread
{
  double first = 0;         ///< [rad]
  double low = 0, high = 0; ///< from the first one [rad]

  void begin(double bearing) { *this = {bearing, 0, 0}; }
  void add(double bearing);
  void add(const BearingSpread &other);
};

/// A trunk of the map with its history. Only the map writes it.
struct MapTrunk
{
  int id = 0;
  std::size_t smoother_id = 0;
  TrunkStatus status = TrunkStatus::candidate;
  RejectReason reject_reason = RejectReason::undecided;
  Trunk trunk; ///< as the smoother has it now
  Matrix5d covariance = Matrix5d::Identity();
  Eigen::Matrix2d place_covariance = Eigen::Matrix2d::Identity(); ///< as the pose that saw it last has it [m^2]
  int observations = 0;                                           ///< summary factors
  std::optional<Eigen::Vector3d> seen_from;                       ///< the camera's place at its last view [m]
  int flipped_in_a_row = 0; ///< frames in which its borders had the other sign where they were expected
  int hits = 0, misses = 0, misses_in_a_row = 0; ///< in frames after the one in which it was found
  int redetections = 0;                          ///< times the detector came to the same hypothesis later
  double contrast = 0;                           ///< running mean of the weaker border's
  double evenness = 0;                           ///< running mean of TrunkView::evenness
  double continuity = 0;                         ///< running mean of TrunkView::continuity
  int continuity_views = 0;                      ///< that told it
  double first_seen_s = 0, last_seen_s = 0;
  std::optional<double> left_contrast, right_contrast; ///< signed, running mean
  BearingSpread left, right;                           ///< of its borders over its views
  double innovation2 = 0;                              ///< running mean of TrunkView::innovation2
  PointCount points;                                   ///< over all frames
  double consistency_odds = 0;                         ///< log-odds by the columns of the last frames,
  int consistency_views = 0;                           ///< and in how many of them it was compared
  bool is_silhouette = false;                          ///< the background was seen beside both its borders
  std::optional<double> final_odds; ///< log-odds by all frames, where they were judged: see TrunkMap::applyDecisions()
  bool removed = false;             ///< out of the smoother
  bool inactive = false;            ///< a candidate that is not looked for any more

  /// By how much the bearing of a border changed [rad]: sideways motion moves both, approach moves them apart.
  double parallax() const { return std::max(left.high - left.low, right.high - right.low); }
  double placeSigma() const { return std::sqrt(place_covariance.trace()); } ///< [m]
  /// Covariance of the axis at the height \p z [m], the log radius and the lean.
  Matrix5d covarianceAt(double z) const;
  /// Points behind it for each point on its bark. 0 for up to 3 points behind it: a slipped track may cause as many.
  double seeThroughRatio() const { return points.behind > 3 ? points.behind / (1.0 + points.on) : 0; }
  /// Log-odds by the points beside it that it stands free and is no strip of a surface. The same points come again in
  /// many frames, so that their number counts by its logarithm.
  double pointsBeside() const { return std::log1p(points.behind_beside) - std::log1p(points.beside); }
  /// Whether points are seen through it in every second frame, as between two trunks: a track that slipped from the
  /// border of a dark trunk is seen behind it for some frames only.
  bool isGap() const { return 2 * points.behind > hits + misses; }
};

/// Log-odds of a strip of a surface against a trunk, by how far what it shows goes on across its borders
/// (continuityOf()). Every other surface shows rows that go on; of trunks 95 in 100 stay below .15, on path-traced,
/// simulated and real flights alike. Below 0 for what does not go on, which counts where a whole flight is known: in
/// flight the surfaces that show no such rows are as likely as before.
double logOddsOfSurface(double continuity);

/// Running mean of the signed contrast of a border; one whose sign flips begins anew. \p now: 0 where it was not seen.
void updateMeanContrast(std::optional<double> &mean, double now);

/// What one view of a trunk adds to its history.
struct TrunkView
{
  double time_s = 0;
  double bearing = 0;                           ///< of the trunk from the camera, world [rad]
  double half_angle = 0;                        ///< of its silhouette [rad]
  double left_contrast = 0, right_contrast = 0; ///< 0: not used
  double evenness = 0;                          ///< of the borders along their length, 0 to 1
  std::optional<double> continuity;             ///< correlation of what it shows with what is beside it
  double innovation2 = 0; ///< mean square of prediction against what was found, over both borders [px^2], divided by
                          ///< what a wide trunk with rough borders is allowed
  Eigen::Vector3d camera = Eigen::Vector3d::Zero(); ///< place of the camera [m]
};

/// What one frame shows of a known trunk that was looked for.
struct TrunkMeasurement
{
  enum class Kind
  {
    seen,
    missed,
    hidden ///< by nearer trunks: nothing is learnt
  };
  int id = 0;
  Kind kind = Kind::missed;
  TrunkView view;          ///< where it was seen
  bool is_flipped = false; ///< borders of the other sign stand where it was expected
};

/// Views compared before columns decide.
inline constexpr int kConsistencyViews = 12;

/// The score of a trunk by photo-consistency over the frames since it was detected.
struct ConsistencyScore
{
  int id = 0;
  double log_odds = 0;        ///< that it is a trunk
  int views = 0;              ///< of both
  double weakest_outside = 0; ///< PhotoConsistency::weakestOutside(): above 0 the background stands beside both borders
};

/// What the detector found, with the views that it was seen in.
struct NewTrunk
{
  std::size_t smoother_id = 0;
  Trunk trunk;
  Matrix5d covariance = Matrix5d::Identity();
  std::vector<TrunkView> views; ///< in the order of time
  double innovation2 = 0;       ///< mean over the views, of the trunk fitted to them
  double found_s = 0;           ///< when [s]
};

/// What the smoother knows of a trunk now.
struct TrunkEstimate
{
  int id = 0;
  Trunk trunk;
  std::optional<Matrix5d> covariance;                             ///< where it was asked for,
  std::optional<Eigen::Matrix2d> place_covariance = std::nullopt; ///< and as the pose that saw it last has it
};

/// The decision of the final pass on one hypothesis.
struct TrunkDecision
{
  int id = 0;
  double log_odds = 0; ///< that it is a trunk
  bool is_trunk = false;
  std::optional<NewTrunk> found; ///< with all its views, where they were looked for anew
};

/// A change of the status of one trunk.
struct MapChange
{
  int id = 0;
  int into = -1; ///< for a merge: the trunk that stays
  TrunkStatus from = TrunkStatus::candidate, to = TrunkStatus::candidate;
};

/// What review() decided, and what the smoother has to do for it.
struct MapUpdate
{
  struct Merge
  {
    std::size_t keep = 0, gone = 0;
  };
  std::vector<MapChange> changes;
  std::vector<Merge> merged;        ///< ids of the smoother: the views of the one become the other's
  std::vector<std::size_t> removed; ///< ids of the smoother: to be forgotten with all their views
  std::vector<int> archived;        ///< ids of the archived ones, of which the map keeps a record alone
};

/// The record of an archived hypothesis: its line in hypotheses.csv, in single precision.
struct ArchivedTrunk
{
  int id = 0, observations = 0;
  TrunkStatus status = TrunkStatus::lost;
  RejectReason reject_reason = RejectReason::none;
  float log_odds = 0;
  std::array<float, 5> trunk{};       ///< x, y, log r, lean x, lean y
  std::array<float, 15> covariance{}; ///< lower triangle, column by column
  double first_seen_s = 0, last_seen_s = 0;
};

/// The map: the only one to write the fields of its trunks. Measurements, point counts and estimates come in, a
/// MapUpdate goes out.
class TrunkMap
{
public:
  explicit TrunkMap(const MapOptions &options = {});
  /// Goes on with \p trunks; their ids are their places.
  TrunkMap(const MapOptions &options, std::vector<MapTrunk> trunks);

  /// Options with lengths in another unit.
  void setOptions(const MapOptions &options);

  /// All hypotheses by their ids, without the archived ones.
  const std::vector<MapTrunk> &trunks() const { return m_trunks; }
  /// One of trunks().
  const MapTrunk &trunk(int id) const { return m_trunks[place(id)]; }
  /// Whether it is looked for.
  bool isActive(int id) const;
  /// Places in trunks() of those that are neither removed nor inactive: what a frame has to look at, however long the
  /// flight.
  const std::vector<std::size_t> &active() const { return m_active; }
  int count(TrunkStatus status) const;

  /// A candidate. The views in which it was found are no test of it: none of them counts as a hit. Returns its id.
  int add(const NewTrunk &found);
  /// Whether a candidate or a confirmed trunk stands where \p found does, so that it is not to be added; one of the
  /// same place and radius counts as found again.
  bool associate(const Trunk &found);
  void record(const TrunkMeasurement &measurement);
  void record(const PointCount &points);
  void record(const ConsistencyScore &odds);
  /// Replaces the trunk \p id by another hypothesis for its lines and forgets what was measured between the former
  /// borders. Returns the id of the former one in the smoother, to be removed there.
  std::size_t replaceHypothesis(int id, const NewTrunk &hypothesis);
  void refresh(const TrunkEstimate &estimate);
  /// Marks a confirmed trunk as missed for long, so that the next review() counts it as lost from sight.
  void markOutOfSight(int id);

  /// Promotes, loses and merges by what is known at \p now_s. Candidates that were not seen for long become inactive:
  /// they keep their views and their place in records(), but those of which nothing was ever seen are removed, since a
  /// drone at rest is offered the same wrong ones in every frame.
  /// \p has_ranges: false while the camera has only rotated, so that a trunk earns its place by its borders alone.
  MapUpdate review(double now_s, bool has_ranges = true);
  /// The same for the end of a flight: inactive candidates take part again.
  MapUpdate reviewAll(bool has_ranges = true);
  /// The same map in which \p ids are the confirmed trunks, and what else was is none.
  TrunkMap withTrunks(const std::vector<int> &ids) const;
  /// Makes the trunks of \p decisions those of the map, with their new views, and removes all others. Returns the ids
  /// that the smoother is to remove.
  std::vector<std::size_t> applyDecisions(const std::vector<TrunkDecision> &decisions);
  /// Removes all active trunks: their ranges were guesses, made before the camera had moved.
  MapUpdate removeUnranged();

  /// Log-odds that \p trunk is a trunk and not a chance pair of lines, from how well its predictions came true, how
  /// often it was missed, how it moved against the background, whether points behind it were seen through it, its
  /// contrast, its radius and how well its place is known. A logistic regression on simulated flights: see
  /// trunk_map.cpp for its weights and what they rest on.
  double evidence(const MapTrunk &trunk) const;
  /// Log-odds that decide: in flight by evidence() and by the columns, whichever says less, at the end by all frames.
  double logOdds(const MapTrunk &trunk) const;
  /// [m] What radii to expect in this wood: its confirmed trunks tell, and before there are any
  /// MapOptions::usual_radius (a hierarchical prior).
  const LogNormal &radii() const { return m_radii; }

  /// As users get it: one that was confirmed and is out of sight is confirmed, one whose place is known less well than
  /// is asked for a candidate. \p has_ranges: false while the camera has only rotated, so that no place is known.
  TrunkStatus statusOf(const MapTrunk &trunk, bool has_ranges = true) const;
  /// \p ground_z of a place [m]; \p breast_height over it, where places are told [m].
  std::vector<TrunkRecord> records(
      const GroundZ &ground_z = [](const Eigen::Vector2d &) { return 0.0; }, double breast_height = kBreastHeight,
      bool has_ranges = true) const;

private:
  std::size_t place(int id) const;
  MapTrunk &at(int id) { return m_trunks[place(id)]; }
  void archive(MapUpdate &update, double now_s);
  TrunkRecord recordOf(const MapTrunk &trunk, double log_odds, double ground_z, double breast_height,
                       bool has_ranges = true) const;
  bool isRejected(const MapTrunk &trunk, bool has_ranges) const;
  bool mayBeConfirmed(const MapTrunk &trunk, bool has_ranges) const;
  bool areTooNear(const Trunk &a, const Trunk &b) const;
  double logOddsGain(const MapTrunk &trunk, const MapTrunk &rival) const;
  bool hasBetterRival(const MapTrunk &trunk, double margin) const;
  MapTrunk *chooseRedundant(MapTrunk &a, MapTrunk &b) const;
  void addView(MapTrunk &trunk, const TrunkView &view) const;
  void updateStatuses(MapUpdate &update, bool has_ranges);
  void mergeDuplicates(MapUpdate &update, double now_s);
  void closeLoops(MapUpdate &update, double now_s);
  void mergeVisits(MapUpdate &update, MapTrunk &keep, MapTrunk &gone);
  void deactivate(MapUpdate &update, double now_s);
  void indexActive();
  void estimateRadii();

  MapOptions m_options;
  std::vector<MapTrunk> m_trunks; ///< by id
  std::deque<ArchivedTrunk> m_archive;
  int m_next_id = 0;
  std::vector<std::size_t> m_active;
  LogNormal m_radii;
};
} // namespace bole
