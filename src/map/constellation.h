// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where on a known map a flight is, by the constellation of the trunks that it has seen itself.
///
/// Idea: two trunks seen and two of the map that stand equally far apart propose a pose (x, y, yaw). A pose is worth
/// the likelihood of all trunks seen, each of which is either one of the map (normal in place and log radius about it)
/// or none (anywhere, of any radius). The posterior weighs all poses found against each other and against the case that
/// the flight is not on the map at all; a constellation that fits twice, or that chance would fit, gets no pose.
///
/// Laws (each a test): the pose of a rotated and shifted part of a map is found; what is not of the map is not placed;
/// a map that is its own mirror or repetition is not decided.

#include <bole/trunk_record.h>

#include <Eigen/Geometry>

#include <optional>
#include <utility>
#include <vector>

namespace bole
{
/// A flight's world on a map: map point = R(yaw) * point + t.
struct Placement
{
  double yaw = 0;                                           ///< [rad]
  Eigen::Vector2d t = Eigen::Vector2d::Zero();              ///< [m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity(); ///< of yaw and t [rad, m, m]
  double probability = 0;                                   ///< that it is this pose and no other, and on the map
  std::vector<std::pair<int, int>> matches;                 ///< ids: seen, in the map

  Eigen::Vector2d operator*(const Eigen::Vector2d &point) const { return Eigen::Rotation2Dd(yaw) * point + t; }
};

/// The pose of the flight that saw \p seen, in the frame of \p map; none where its probability is below \p certain or
/// fewer than three trunks speak for it.
std::optional<Placement> placeOnMap(const std::vector<TrunkRecord> &seen, const std::vector<TrunkRecord> &map,
                                    double certain = 0.999);
} // namespace bole
