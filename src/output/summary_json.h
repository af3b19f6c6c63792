// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a run was made of and what came out, for people and scripts.

#include "output/timing_csv.h"
#include <bole/frame.h>
#include <bole/trunk_record.h>
#include <bole/world_reference.h>

#include <map>
#include <string>
#include <vector>

namespace bole
{
struct RunSummary
{
  std::string version; ///< of bole
  std::string input, preset, camera_file, odometry_file;
  std::string note; ///< FrameSource::note()
  PinholeCamera camera;
  bool has_odometry = false, has_gyro = false;
  bool is_complete = true;  ///< false: the run was stopped, this is what was known by then
  WorldReference reference; ///< where the metre and up come from
  std::map<FrameStatus, std::size_t> frames;
  std::vector<TrunkRecord> trunks;
  TimingTable timing;
  std::map<std::string, double> figures; ///< anything else a stage counts, by name
};

/// Inputs, preset, camera, frames by status, trunks by status with the medians of their radius, standard deviation and
/// observations, sources of scale and gravity, median cost by stage, versions of the libraries.
std::string toJson(const RunSummary &summary);
/// Sources of scale and gravity of a summary.json. Throws vpException naming the file when it is none.
WorldReference readReference(const std::string &path);
/// toJson(), written atomically.
void writeSummary(const std::string &path, const RunSummary &summary);
} // namespace bole
