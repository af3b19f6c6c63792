// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map as users get it: its trunks with position, radius, what is known of their errors and their life, those that
/// a frame sees, and where its scale and the direction of gravity come from.

#include <bole/trunk.h>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <string>

namespace bole
{
/// [m] above the ground.
constexpr double kBreastHeight = 1.3;

/// Life cycle of a trunk of the map.
enum class TrunkStatus
{
  candidate, ///< seen too little to be relied on
  confirmed, ///< part of the map
  lost,      ///< given up: see RejectReason
  merged     ///< a duplicate, now part of another trunk
};

/// As trunks.csv writes it.
const char *toString(TrunkStatus status);

/// Why a hypothesis is no trunk of the map.
enum class RejectReason
{
  none,      ///< it is one
  undecided, ///< the flight ended before enough was seen of it
  unseen,    ///< found once and never again
  missed,    ///< too often not found where it was predicted
  doubted,   ///< its log-odds to be a trunk fell too low
  outdone,   ///< another hypothesis for the same place was better
  duplicate, ///< the same trunk as another, which has its views now
  unranged   ///< found before the camera had moved, at a range that was a guess
};

/// As hypotheses.csv writes it.
const char *toString(RejectReason reason);

/// A trunk in the world frame. Position and radius are those at breast height, where forest inventories measure (and
/// the ground truth of the rendered flights is given): the axis at kBreastHeight above the ground. For an upright trunk
/// the height does not matter; one that leans by 3 degrees is 7 cm off at its foot. Without a known ground (no
/// odometry) the height of the first camera stands in.
///
/// A trunk that was confirmed and went out of sight stays confirmed.
struct TrunkRecord
{
  using Covariance = Eigen::Matrix<double, 5, 5>; ///< of x, y, radius [m], lean x, lean y

  int id = 0;                                      ///< in the map; never given twice
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();    ///< [m]
  double radius = 0;                               ///< [m]
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();  ///< tan of the lean towards x and y
  double ground_z = 0;                             ///< height of the ground in the world [m]
  double probability = 0;                          ///< that it is a trunk and not a chance pair of lines, 0 to 1
  Covariance covariance = Covariance::Identity();  ///< of x, y, radius, lean x, lean y
  int observations = 0;                            ///< views: frames with a summary factor
  double first_seen_s = 0;                         ///< [s], from the first frame
  double last_seen_s = 0;                          ///< [s], from the first frame
  TrunkStatus status = TrunkStatus::candidate;     ///< in its life cycle
  RejectReason reject_reason = RejectReason::none; ///< of what is not confirmed

  Eigen::Matrix2d covarianceXy() const { return covariance.topLeftCorner<2, 2>(); }         ///< [m^2]
  double positionSigma() const { return std::sqrt(std::max(0.0, covarianceXy().trace())); } ///< [m]
  double radiusSigma() const { return std::sqrt(std::max(0.0, covariance(2, 2))); }         ///< [m]
};

/// A known trunk that was looked for in the frame.
struct TrunkInView
{
  int id = 0;                                  ///< in the map
  TrunkStatus status = TrunkStatus::candidate; ///< in the map
  bool is_tracked = false;                     ///< measured in this frame
  const char *outcome = "";                    ///< of the search for it: "tracked", "occluded", ...
  RelativeTrunk relative;                      ///< as measured, else as predicted
  double tan_low = 0;                          ///< part looked at: tangents of elevation
  double tan_high = 0;                         ///< part looked at: tangents of elevation
  double distance = 0;                         ///< from the camera to the axis [m]; 0 where no range is known
};

/// Where the scale of the map comes from.
enum class ScaleSource
{
  odometry, ///< the pose filter
  height,   ///< a known height over the ground
  prior     ///< the radius a trunk usually has: distances are right only as far as that is
};
/// As summary.json writes it.
const char *toString(ScaleSource source);

/// Where the direction of gravity comes from.
enum class GravitySource
{
  odometry, ///< the pose filter
  trunks,   ///< the common vanishing point of the trunks
  assumed   ///< the first image is taken to be upright
};
/// As summary.json writes it.
const char *toString(GravitySource source);

/// Where the scale and the direction of gravity of a map come from.
struct WorldReference
{
  ScaleSource scale = ScaleSource::odometry; ///< source of the scale
  double scale_sigma = 0; ///< relative standard deviation of all lengths together, 0 where the source does not say
  GravitySource gravity = GravitySource::odometry; ///< source of the direction of gravity
  double gravity_sigma = 0;                        ///< of up [rad], 0 where the source does not say
  /// False: the camera only turned, so that trunks have a bearing and a width; their ranges are those of the prior on
  /// the radius.
  bool has_ranges = true;
};

/// "scale: prior on the radius (+- 19 %); up: trunks (+- 0.8 degrees)"; for pictures and tables.
std::string describe(const WorldReference &reference);
} // namespace bole
