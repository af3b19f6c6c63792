// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What was known frame by frame, each line as of right after its frame: for pictures and for those who ask how a
/// figure came about. Second line of each table: units, as in trunks.csv.

#include <bole/frame.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace bole
{
struct FrameTrace
{
  std::size_t index = 0;
  std::int64_t stamp_ns = 0;
  FrameStatus status = FrameStatus::ok;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();         ///< of the body in the world [m]
  Eigen::Matrix2d covariance_xy = Eigen::Matrix2d::Zero(); ///< [m^2], the common error of the scale left out
  std::string reason = {};                                 ///< why the status is not ok
};

/// A confirmed trunk as a frame measured it.
struct TrunkTrace
{
  std::size_t frame = 0;
  std::int64_t stamp_ns = 0;
  int id = 0;
  double range = 0;                             ///< from the camera to the axis [m]
  double range_sigma = 0;                       ///< [m]; that of the radius: an image knows their ratio far better
  double radius = 0, radius_sigma = 0;          ///< [m]
  Eigen::Vector2d xy = Eigen::Vector2d::Zero(); ///< in the world [m]
  Eigen::Vector2d xy_sigma = Eigen::Vector2d::Zero();
};

/// Points with a parallax, counted in squares of the ground plane.
class GroundEvidence
{
public:
  static constexpr double kSide = 0.1; ///< of a square [m]

  void add(const Eigen::Vector3d &point, int count = 1);
  /// Middle of each square [m] and its points.
  std::vector<std::pair<Eigen::Vector2d, int>> squares() const;

private:
  std::map<std::pair<int, int>, int> m_counts;
};

struct FlightTrace
{
  std::vector<FrameTrace> frames;
  std::vector<TrunkTrace> views;
  GroundEvidence evidence;
};

/// Writes frames.csv, views.csv and evidence.csv into \p folder, atomically.
void writeTrace(const std::string &folder, const FlightTrace &trace);
/// Reads them. Errors: vpException with file:line.
FlightTrace readTrace(const std::string &folder);
/// frames.csv alone.
std::vector<FrameTrace> readFrames(const std::string &folder);
} // namespace bole
