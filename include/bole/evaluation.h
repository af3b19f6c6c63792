// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A finished run against the ground truth of its sequence: what `bole evaluate` prints.
///
/// Law (a test): a figure for which there was nothing to measure is NaN. It is printed as "-" and is null in JSON, so
/// that a failure never looks like an error of zero.

#include <bole/pose.h>
#include <bole/trunk_record.h>

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace bole
{
/// The figure of what could not be measured.
constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

/// What is taken from the estimate before it is compared with the truth.
enum class Alignment
{
  none,        ///< both are taken in the world as they stand
  first_pose,  ///< x, y, z and yaw of the first common pose: the gauge of the estimate's covariances
  xy_yaw,      ///< least squares over the trajectory in x, y and yaw; z stays
  xy_yaw_scale ///< the same with the scale of the horizontal plane; z stays
};
/// As it is written in reports.
const char *toString(Alignment alignment);
/// Place in a ByAlignment.
inline std::size_t indexOf(Alignment alignment) { return static_cast<std::size_t>(alignment); }

/// One figure for each Alignment.
using ByAlignment = std::array<double, 4>;
constexpr ByAlignment kNoneMeasured = {kNotMeasured, kNotMeasured, kNotMeasured,
                                       kNotMeasured}; ///< nothing was measured

/// Errors of a trajectory after an alignment.
struct TrajectoryErrors
{
  std::size_t poses = 0;              ///< compared with the truth
  double ate = kNotMeasured;          ///< absolute trajectory error: RMSE of the position in 3-D [m]
  double ate_xy = kNotMeasured;       ///< its horizontal part [m]
  double rotation_deg = kNotMeasured; ///< RMSE of the angle [degrees]
};

/// Errors of relative motion over an interval.
struct RelativeErrors
{
  std::size_t intervals = 0;          ///< compared with the truth
  double translation = kNotMeasured;  ///< RMSE over the interval [m]
  double rotation_deg = kNotMeasured; ///< [degrees]
};

/// What is said of one trajectory.
struct TrajectoryReport
{
  std::array<TrajectoryErrors, 4> absolute; ///< by Alignment
  double scale = kNotMeasured;              ///< by which Alignment::xy_yaw_scale multiplies the estimate
  RelativeErrors over_frame;                ///< between consecutive frames, and over 1 s
  RelativeErrors over_second;               ///< between consecutive frames, and over 1 s
};

/// What a flight saw of a trunk of the truth.
struct TrunkVisibility
{
  std::size_t frames = 0;    ///< within range, inside the image, not hidden
  double bearing_change = 0; ///< largest difference of its bearings over those frames [degrees]
  double min_range = 0;      ///< of those frames [m]
  bool is_expected = false;  ///< counts for recall
};

/// A trunk of the map and the one of the truth it was matched with.
struct TrunkMatch
{
  TrunkRecord estimate;               ///< as the map has it
  int truth_id = 0;                   ///< its partner
  double truth_radius = kNotMeasured; ///< [m]
  TrunkVisibility visibility;         ///< of the partner, by the true trajectory
  ByAlignment error = kNoneMeasured;  ///< distance under each Alignment [m]
  double nees_half = kNotMeasured;    ///< e^T P^-1 e / 2, with the first pose as gauge
  double predicted_sigma = 0;         ///< sqrt(trace P) [m], to be compared with the RMSE of the distance
  double radius_error = kNotMeasured; ///< estimate - truth [m]
};

/// A trunk of the map without partner, or one of the truth that was expected and not found.
struct Unmatched
{
  int id = 0;                             ///< in its own set
  int nearest_id = -1;                    ///< in the other set (for a miss: any status), -1 where that is empty
  double nearest_distance = kNotMeasured; ///< [m], after TrunkMetrics::matching
  bool is_duplicate = false;              ///< within the gate of a trunk of the truth that has a better partner
  TrunkRecord estimate;                   ///< false positive: the trunk; miss: the nearest of the map
  TrunkVisibility visibility;             ///< of the missed trunk
};

/// Figures of a set of matches.
struct TrunkErrors
{
  std::size_t expected = 0;              ///< trunks of the truth that count for recall
  std::size_t found = 0;                 ///< trunks of the truth that count for recall
  std::size_t matches = 0;               ///< trunks of the map with a partner
  ByAlignment median = kNoneMeasured;    ///< of the distance under each Alignment [m]
  ByAlignment rmse = kNoneMeasured;      ///< of the distance under each Alignment [m]
  double nees_half = kNotMeasured;       ///< mean; near 1 when covariances are honest
  double predicted_sigma = kNotMeasured; ///< root mean square [m]
  double radius_rmse = kNotMeasured;     ///< of the matched trunks [m]
  double radius_bias = kNotMeasured;     ///< of the matched trunks [m]
  double recall() const;                 ///< found / expected
};

/// Errors of the trunks of one stratum.
struct TrunkBin
{
  std::string name;   ///< such as "2 to 4 m"
  TrunkErrors errors; ///< of the trunks in it
};

/// How good a map of trunks is. Shares are 0 .. 1.
struct TrunkMetrics
{
  Alignment matching = Alignment::xy_yaw; ///< after which the trunks were matched
  std::size_t confirmed = 0;              ///< trunks of the map that were judged
  double precision = kNotMeasured;        ///< matched / confirmed, against all trunks of the truth, near and far
  double recall = kNotMeasured;           ///< expected and matched / expected (TrunkVisibility::is_expected)
  double f1 = kNotMeasured;               ///< harmonic mean of precision and recall
  double duplicates = kNotMeasured;       ///< share of the confirmed trunks
  TrunkErrors all;                        ///< of all matched trunks
  std::vector<TrunkBin> by_range;         ///< by nearest range, and by the change of bearing while in view
  std::vector<TrunkBin> by_parallax;      ///< by nearest range, and by the change of bearing while in view
  std::vector<TrunkMatch> matches;        ///< trunks of the map with their partners
  std::vector<Unmatched> false_positives; ///< trunks of the map without partner
  std::vector<Unmatched> misses;          ///< expected ones of the truth without partner
};

/// A run against the truth of its sequence, or against another run.
struct Evaluation
{
  std::string run;                          ///< folders that were compared
  std::string sequence;                     ///< folders that were compared
  bool is_against_run = false;              ///< `sequence` is another run
  std::optional<double> time_shift_s;       ///< added to the run's stamps, where that was asked for
  std::size_t frames = 0;                   ///< of the sequence
  TrajectoryReport smoothed;                ///< trajectory.tum
  std::optional<TrajectoryReport> online;   ///< trajectory_online.tum
  std::optional<TrajectoryReport> odometry; ///< the pose filter at the frames of trajectory.tum
  std::optional<TrunkMetrics> trunks;       ///< where the sequence has trees.csv
  std::string reference; ///< describe() of the run's scale and gravity, from its summary.json; empty without one
  /// Mean e^T P^-1 e / 2 of the online positions in the plane at the last scale, which their covariances leave out:
  /// near 1 when these are honest. Where the scale is the odometry's.
  double online_nees_half = kNotMeasured;
};

/// Writes trajectory.tum and trunks.csv into the folder \p run: all that evaluate() needs of one. For programs that map
/// by themselves. \throw vpException naming the file that cannot be written.
void writeRun(const std::string &run, const std::vector<TrunkRecord> &map, const Trajectory &smoothed);

/// Compares the folder \p run (trajectory.tum, trunks.csv) with the ASL folder \p sequence, or with another run: then
/// its smoothed trajectory and its trunks stand for the truth, all of them expected, and what is measured is how alike
/// two runs are. Where the summary of the run says that its scale is not odometry's, trunks are matched after alignment
/// in scale too; where its world stands at the height of the first camera, the mean height is aligned.
/// \p align_time: for live flights, whose stamps are the drone's: shifts the run's stamps so that its motion is that of
/// the truth.
/// \throw vpException naming the file that is missing or faulty, or that has no common stamps with the truth.
Evaluation evaluate(const std::string &run, const std::string &sequence, bool align_time = false);

/// The table for a terminal. \p verbose lists every trunk of the truth that counts with its match or its nearest
/// neighbour, and every false positive and duplicate.
std::string toTable(const Evaluation &evaluation, bool verbose);

/// Everything, as JSON.
std::string toJson(const Evaluation &evaluation);
} // namespace bole
