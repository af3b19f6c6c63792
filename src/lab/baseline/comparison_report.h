// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A comparison as text for the terminal, as JSON for programs (apps/campaign/figures.py draws it), and as a video in
/// which each tracker shows where it believes the model to be.

#include "baseline/basin.h"
#include "baseline/faults.h"

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

/// Writes a video of two columns to \p path (mp4): a picture for each of \p scores that had a prior, with the model
/// \p cao_path drawn where its pose puts it and its error below: green where it is right, orange where it complained,
/// red where it is wrong in silence. Nothing is written when there is none.
///
/// \throw vpException naming the file, when it cannot be written.
void writeComparisonVideo(const std::string &path, const TestFlight &flight, const std::string &cao_path,
                          const std::vector<Score> &scores);
} // namespace bole
