// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One trunk of the map as users get it: position, radius, what is known of their errors, its life.

#include <Eigen/Core>

namespace bole
{
/// [m] above the ground.
constexpr double kBreastHeight = 1.3;

/// Life cycle of a trunk of the map.
enum class TrunkStatus
{
  candidate, ///< seen too little to be relied on
  confirmed, ///< part of the map
  lost,      ///< a candidate that could not be followed long enough to be confirmed
  merged     ///< a duplicate, now part of another trunk
};

inline const char *toString(TrunkStatus status)
{
  switch (status) {
  case TrunkStatus::candidate:
    return "candidate";
  case TrunkStatus::confirmed:
    return "confirmed";
  case TrunkStatus::lost:
    return "lost";
  case TrunkStatus::merged:
    return "merged";
  }
  return "unknown";
}

/// A trunk in the world frame. Position and radius are those at breast height, where forest
/// inventories measure (and the ground truth of the rendered flights is given): the axis at
/// kBreastHeight above the ground. For an upright trunk the height does not matter; one that leans
/// by 3 degrees is 7 cm off at its foot. Without a known ground (no odometry) the height of the
/// first camera stands in.
struct TrunkRecord
{
  int id = 0;
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();                ///< [m]
  double radius = 0;                                           ///< [m]
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();              ///< tan of the lean towards x and y
  Eigen::Matrix2d covariance_xy = Eigen::Matrix2d::Identity(); ///< [m^2]
  double variance_radius = 0;                                  ///< [m^2]
  int observations = 0;                                        ///< frames with a summary factor
  double first_seen_s = 0, last_seen_s = 0;
  TrunkStatus status = TrunkStatus::candidate;
};
} // namespace bole
