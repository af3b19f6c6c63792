// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The files that trajectories come in, and poses between those of a trajectory.

#include <bole/pose.h>

#include <cstdint>
#include <optional>
#include <string>

namespace bole
{
/// Pose at \p stamp_ns: that of the sample itself, or between its two neighbours on SE(3)
/// (translation linear, rotation along the geodesic). Nothing outside the range of the trajectory
/// and nothing between neighbours more than \p max_gap_ns apart. Cost: log2 of the number of poses.
///
/// Laws (each a test): at a sample, the sample; half way between a and b, a.plus(b.minus(a) / 2).
std::optional<Pose> interpolate(const Trajectory &trajectory, std::int64_t stamp_ns,
                                std::int64_t max_gap_ns = 1'000'000'000);

/// Reads a trajectory: TUM ("t tx ty tz qx qy qz qw" in seconds, blank separated) when the first row has no comma, else
/// ASL / EuRoC ("stamp [ns],x,y,z,qw,qx,qy,qz[,...]"). Errors: vpException with file:line for a row that is not eight
/// finite numbers, a quaternion whose norm is not 1 to 1 %, a stamp that goes back, or an empty file.
Trajectory readTrajectory(const std::string &path);
Trajectory readAslTrajectory(const std::string &path);
Trajectory readTumTrajectory(const std::string &path);

/// \p stamp_ns as seconds with nine decimals: exact.
std::string secondsText(std::int64_t stamp_ns);

/// First line of such a file, and the line of a pose.
extern const char *const kTrajectoryHead;
std::string trajectoryLine(const StampedPose &pose);

/// Writes "t tx ty tz qx qy qz qw" a line (seconds with nine decimals, metres, body in world, qw >=
/// 0), atomically. Law (a test): readTumTrajectory() gives the stamps exactly and the poses to
/// 1e-8.
void writeTrajectory(const std::string &path, const Trajectory &trajectory);
} // namespace bole
