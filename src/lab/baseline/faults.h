// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What trackers say and do when the camera or its link fails for a few frames.
///
/// Idea: pieces of a flight, each started at the true pose a few frames before some of its images are replaced. A
/// failure is silent when the pose is wrong and nothing is said, during the fault or after it. Recovered is the first
/// frame after the fault that is right without complaint and stays so for two more; nobody helps beyond what Help says.

#include "baseline/comparison.h"
#include "faults/fault.h"

namespace bole
{
struct FaultCase
{
  FaultKind kind = FaultKind::black;
  int frames = 1; ///< in a row
  std::string text() const;
};
/// Black and noise for 1 and 5 frames, a smeared half for 1, frozen for 10, a wrong size for 1.
std::vector<FaultCase> allFaults();

/// Where the pieces of the flight lie.
struct FaultRuns
{
  std::vector<std::size_t> begins{20, 40, 60,
                                  80}; ///< frames at which the fault begins; those near the end are left out
  int lead = 5;                        ///< frames tracked before it
  int tail = 15;                       ///< and after it
};

struct FaultRow
{
  std::string name;
  FaultCase fault;
  int runs = 0;
  int fault_frames = 0, noticed = 0; ///< frames replaced, and those at which the tracker complained
  int silent_failures = 0;           ///< frames wrong without complaint, from the beginning of the fault
  int recovered = 0;                 ///< runs
  int slowest = 0;                   ///< frames to recovery in the slowest run that recovered; 1: at once
};

/// Rows of all \p contenders, a fault each, in the order of allFaults().
std::vector<FaultRow> faults(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                             const FaultRuns &runs = {}, const Limits &limits = {});
} // namespace bole
