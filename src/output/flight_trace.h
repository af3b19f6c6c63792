// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Tables of what was known frame by frame, right after each frame, and of what each frame cost: for pictures and for
/// those who ask how a figure came about. The second line of each table but timing.csv holds units, as in trunks.csv.

#include <bole/frame.h>

#include <cstdint>
#include <map>
#include <optional>
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

/// Counts the points that have a parallax in squares of the ground plane.
class GroundEvidence
{
public:
  static constexpr double kSide = 0.1; ///< of a square [m]

  void add(const Eigen::Vector3d &point, int count = 1);
  /// Returns the middle of each square [m] and the number of its points.
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
/// Reads what writeTrace() wrote. Errors: vpException with file:line.
FlightTrace readTrace(const std::string &folder);
/// Reads frames.csv alone.
std::vector<FrameTrace> readFrames(const std::string &folder);

/// A frame and what each stage cost in it.
struct FrameTiming
{
  std::size_t index = 0;
  std::int64_t stamp_ns = 0;
  std::vector<double> stages_ms; ///< in the order of TimingTable::stages
  double total_ms = 0;           ///< of the whole frame, without input and output
  /// In a live run, the time from the arrival of the frame's last byte until the map knew of it.
  std::optional<double> age_ms;
};

struct TimingTable
{
  std::vector<std::string> stages;
  std::vector<FrameTiming> frames;

  /// Returns the median over the frames, NaN without frames.
  double medianTotal_ms() const;
  double medianStage_ms(std::size_t stage) const;
  /// Returns the cost that 95 % of the frames stay below.
  double percentile95_ms() const;
  /// Returns the age below which the share \p quantile of the frames that have an age stays; nothing where none has.
  std::optional<double> age_ms(double quantile) const;
};

/// Prints a line a stage and one for the whole frame: median, 95th and 99th percentile, most.
std::string toText(const TimingTable &timing);

/// Writes a line a frame under the header "frame,timestamp [s],<stage> [ms],...,total [ms]", to which a live run adds
/// "age [ms]", atomically.
void writeTiming(const std::string &path, const TimingTable &timing);
TimingTable readTiming(const std::string &path);
} // namespace bole
