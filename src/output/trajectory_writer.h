// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Trajectories as TUM text.

#include "input/trajectory.h"

#include <string>

namespace bole
{
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
