// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A closed-loop flight as a figure and as a table.

#include "lab/trials/closed_loop.h"

#include <string>

namespace bole
{
/// SVG: one panel an error, over the time since take-off; what the task believed thin, the truth bold. The search is
/// grey, hovering in doubt red.
std::string errorCurves(const LoopRecord &record, const std::string &title);

/// A row a frame: time, phase, status, true and estimated place, command, speed, clearance, loop time, errors.
std::string samplesCsv(const LoopRecord &record);
} // namespace bole
