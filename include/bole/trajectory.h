// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Poses of the body in the world with their timestamps.

#include <bole/pose.h>

#include <cstdint>
#include <vector>

namespace bole
{
/// A pose and its time.
struct StampedPose
{
  std::int64_t stamp_ns = 0; ///< of the frame
  Pose wMb;                  ///< world from body
};

/// Poses with strictly rising stamps.
using Trajectory = std::vector<StampedPose>;
} // namespace bole
