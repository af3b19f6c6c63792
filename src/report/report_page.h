// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The page about a run: one file that a browser opens without network.

#include "input/trajectory.h"
#include "output/flight_trace.h"
#include <bole/evaluation.h>
#include <bole/open_source.h>
#include <bole/trunk_record.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace bole
{
/// All that the folder of a run holds, read back for the page about it.
struct RunRecord
{
  std::string folder, input, working_folder, note, sha256;
  std::vector<std::string> command, facts, doubts;
  std::map<std::string, std::string> versions;
  std::vector<SensorVerdict> sensors;
  bool is_trusted = true, has_ranges = true;
  double scale_sigma = 0;          ///< of the logarithm of the scale; 0 where odometry gives it
  std::vector<std::string> videos; ///< names of those beside the page
  std::vector<TrunkRecord> trunks; ///< and hypotheses
  std::map<int, std::string> views_jpeg;
  Trajectory smoothed, online;
  FlightTrace trace;
  TimingTable timing;

  // where there is a truth, in the world of the run
  Trajectory truth;
  std::vector<TruthTrunk> truth_trunks;
  std::optional<Evaluation> evaluation;
};

/// Reads the folder \p run; \p sequence: ASL folder with its truth, or empty.
/// \throw vpException naming the file that is missing or faulty.
RunRecord readRun(const std::string &run, const std::string &sequence);

/// Returns what the page shows as JSON; the script in page.html draws it.
std::string reportJson(const RunRecord &run);

/// Puts reportJson() into page.html: the page tells what the run is worth, its map, trunks, time line, trajectory and
/// cost, what to do next and how to repeat it.
std::string reportHtml(const RunRecord &run);

/// Writes RUN/report.html from what the folder \p run holds; \p sequence: ASL folder with the truth, or empty.
/// \throw vpException naming the file that is missing or faulty.
void writeReport(const std::string &run, const std::string &sequence);
} // namespace bole
