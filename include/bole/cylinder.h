// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A cylinder of any direction and finite length, as a `.cao` model knows it.
///
/// Idea: RelativeTrunk is exact for every direction of the axis; only bole::Trunk (a map's upright trunk)
/// is not. So a general cylinder becomes a RelativeTrunk straight from its axis in the camera frame: x from
/// the camera centre to the nearest point of the axis, z along the axis from `foot` to `top`.

#include <bole/trunk.h>
#include <bole/trunk_record.h>

#include <string>
#include <vector>

namespace bole
{
/// Cylinder of radius \p radius [m] round the segment from foot to top [m], in a frame that the variable names.
struct Cylinder
{
  Eigen::Vector3d foot = Eigen::Vector3d::Zero(); ///< [m]
  Eigen::Vector3d top = Eigen::Vector3d::UnitZ(); ///< [m]
  double radius = 0.15;                           ///< [m]
  std::string name;                               ///< in a model; may be empty

  /// Unit direction from foot to top.
  Eigen::Vector3d axis() const { return (top - foot).normalized(); }
};

/// The cylinder \p b, given in frame b, in frame a.
Cylinder operator*(const Pose &aMb, const Cylinder &b);

/// The part of the trunk \p trunk between the heights \p foot_z and \p top_z [m] of the world: one cylinder of a `.cao`
/// model in the world frame.
Cylinder cylinderOf(const Trunk &trunk, double foot_z, double top_z, const std::string &name = "");

/// The part of a mapped trunk from just over the ground to what a flight sees of it, named trunk_ID.
Cylinder cylinderOf(const TrunkRecord &trunk);

/// Relative trunk of the cylinder \p c given in the camera frame. Not isFinite() when the camera centre is
/// inside the (endless) cylinder or on its axis.
///
/// Law (a test): for the cylinder along a bole::Trunk it is relativeTrunk() of that trunk.
RelativeTrunk relativeTrunk(const Cylinder &c);

/// Where a silhouette plane touches the cylinder \p c of the camera frame: the segment [m] of the contact
/// line beside foot and top. \p relative is relativeTrunk(c).
struct ContactLine
{
  Eigen::Vector3d foot; ///< lower end [m]
  Eigen::Vector3d top;  ///< upper end [m]
};
/// On the side \p border.
ContactLine contactLine(const Cylinder &c, const RelativeTrunk &relative, Border border);

/// Writes \p cylinders as a `.cao` model (V1) that vpMbTrunkTracker and ViSP's own trackers read.
/// \throw vpException when the file cannot be written.
void writeCao(const std::string &path, const std::vector<Cylinder> &cylinders, const std::string &comment = "");
} // namespace bole
