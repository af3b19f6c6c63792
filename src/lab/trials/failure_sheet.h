// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Why a flight failed, as a page made by the program: what the drone believed, what was true, and the frame in which
/// the two parted.

#include "lab/simulation/forest.h"
#include "lab/trials/closed_loop.h"

#include <optional>
#include <string>

namespace bole
{
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

/// An HTML page: the outcome, the parting, a map of the last metres as they were and as they were believed (moved to
/// where the drone truly was), the errors over time. \p picture: file of the frame of the parting; empty for none.
std::string failureSheet(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks, const std::string &title,
                         const std::optional<Parting> &parting, const std::string &picture);
} // namespace bole
