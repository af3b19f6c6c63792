// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Recorded flights in EuRoC / ASL folders.

#include "input/recorded_source.h"

namespace bole
{
/// Reads `mav0/cam0` and, where they are there, `imu0` (gyro), `odom0` (the pose filter on board) and
/// `state_groundtruth_estimate0` (truth). The folder may be given as the sequence or as its `mav0`.
///
/// Every row of cam0/data.csv becomes one frame: an image that is absent is `missing`, one that cannot be decoded
/// `corrupt`, one of another size `resized`, one with the pixels of the frame before `stale`. The pose filter's pose is
/// that at the stamp of the frame (interpolate()), absent outside its range; gyro samples are those of (previous frame,
/// this frame]. A `sensor.yaml` beside imu0, odom0 or the truth may give its `T_BS`; angular rates and poses are
/// carried to the body by it.
///
/// Errors: vpException with file:line for a missing or empty folder, rows that are not what they must be, stamps that
/// go back, a camera file with a fault, or images of another size than the camera's.
class AslSource : public ImageFilesSource
{
public:
  explicit AslSource(const std::string &folder, const SourceOptions &options = {});

  /// Stamps of all frames [ns]; the whole odometry and the whole truth, each may be empty.
  std::vector<std::int64_t> stamps() const;
  const Trajectory &odometry() const;
  const Trajectory &truth() const;

  /// Whether \p path looks like such a folder.
  static bool accepts(const std::string &path);
};
} // namespace bole
