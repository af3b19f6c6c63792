// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How a recorded flight is read.

#include <string>

namespace bole
{
/// Options of every frame source. validate() throws vpException "name = value, must be ...".
struct SourceOptions
{
  std::string camera_path;   ///< camera file (readCamera()); empty: the one of the folder, or a guess
  std::string odometry_path; ///< trajectory file (readTrajectory()); empty: the one of the folder, or none
  /// [s], added to the stamps of odometry_path so that they count as the video's do. Default 0.
  double odometry_offset_s = 0;
  /// [s], > 0: between odometry samples further apart than this nothing is interpolated. Default 1:
  /// a body in flight is not where a straight line says after longer.
  double max_odometry_gap_s = 1;
  /// [Hz], > 0, 1e-3 to 1e4: rate of numbered images, which have no stamps of their own.
  /// Default 25.
  double frame_rate_hz = 25;
  /// [px], 0 (keep) or >= 64: wider images are shrunk to this. Default 640: see Rectifier.
  int max_width_px = 640;
  /// [degrees], 10 to 150: horizontal field of view that is assumed, and said, where no camera is
  /// given. Default 65: between a phone's video and an action camera's.
  double field_of_view_deg = 65;

  void validate() const;
};
} // namespace bole
