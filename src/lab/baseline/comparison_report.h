// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A comparison as text for the terminal, as JSON for programs, and as one HTML page with its plots.

#include "lab/baseline/basin.h"
#include "lab/baseline/faults.h"

#include <string>
#include <vector>

namespace bole
{
struct ComparisonReport
{
  std::string sequence, command;
  int frames = 0, trunks = 0; ///< of the flight; of the model
  Limits limits;
  std::vector<Score> scores;
  std::vector<SweepResult> sweeps;
  std::vector<Score> timing; ///< on the true pose, the same trunks for all; empty: not measured
  std::vector<BasinRow> basin;
  std::vector<FaultRow> faults;
};

std::string toTable(const ComparisonReport &report);
std::string toJson(const ComparisonReport &report);
/// Position error by frame of all trackers: the plot of the page alone.
std::string toSvg(const ComparisonReport &report);
/// Self-contained; position error by frame, basins and faults as inline SVG and tables.
std::string toHtml(const ComparisonReport &report);
} // namespace bole
