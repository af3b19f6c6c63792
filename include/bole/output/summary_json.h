// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a run was made of and what came out, for people and scripts.

#include <bole/input/frame.h>
#include <bole/map/trunk_record.h>
#include <bole/output/timing_csv.h>

#include <map>
#include <string>
#include <vector>

namespace bole
{
/// Where the metre of the map comes from.
enum class ScaleSource {
  odometry, ///< the pose filter
  height,   ///< a known height over the ground
  prior     ///< the radius a trunk usually has: distances are right only as far as that is
};
const char *toString(ScaleSource source);

struct RunSummary
{
  std::string version;                   ///< of bole
  std::string input, preset, camera_file, odometry_file;
  std::string note;                      ///< FrameSource::note()
  PinholeCamera camera;
  bool has_odometry = false, has_gyro = false;
  bool is_complete = true;               ///< false: the run was stopped, this is what was known by then
  ScaleSource scale = ScaleSource::odometry;
  std::map<FrameStatus, std::size_t> frames;
  std::vector<TrunkRecord> trunks;
  TimingTable timing;
  std::map<std::string, double> figures; ///< anything else a stage counts, by name
};

/// Inputs, preset, camera, frames by status, trunks by status with the medians of their radius, standard deviation and
/// observations, scale source, median cost by stage, versions of the libraries.
std::string toJson(const RunSummary &summary);
/// toJson(), written atomically.
void writeSummary(const std::string &path, const RunSummary &summary);
} // namespace bole
