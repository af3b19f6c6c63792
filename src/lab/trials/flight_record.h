// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A closed-loop flight as tables: what was done, and why it failed. `apps/campaign/figures.py` draws them.

#include "simulation/forest.h"
#include "trials/closed_loop.h"

#include <optional>
#include <string>

namespace bole
{
/// A row a frame: time, phase, status, true and estimated place, command, speed, clearance, loop time, errors.
std::string samplesCsv(const LoopRecord &record);

/// The first of half a second of frames in which something the task flies by was wrong.
struct Parting
{
  std::size_t sample = 0;
  std::string what; ///< one line
};

/// Asked in this order, of each frame: an error of the task that it believes otherwise than it is (by half a degree, 3
/// per cent, or .3 of any other unit); within 4 m a confirmed trunk where none stands within .6 m, or one that is .3 m
/// off; within 2 m and 35 degrees of straight ahead a trunk that the map does not hold. None: belief was right, what
/// failed is control.
std::optional<Parting> findParting(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks);

/// Why a flight failed, as JSON: the outcome, the parting, and at the parting and at the end the drone, the trunks as
/// they are and as they are believed (moved to where the drone truly was).
std::string failureJson(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks, const std::string &title,
                        const std::optional<Parting> &parting);
} // namespace bole
