// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The laboratory's subcommands of `bole`: see commands.h.

#include "commands.h"

namespace bole::apps
{
void addCompare(CLI::App &app); ///< our tracker against ViSP's
void addSimulate(CLI::App &app);
void addServo(CLI::App &app);        ///< tasks in the closed loop
void addReplay(CLI::App &app);       ///< a recorded flight, served again
void addEmulate(CLI::App &app);      ///< a sequence, served as an AR.Drone would
void addShowSaliency(CLI::App &app); ///< saliency beside images
void addReproduce(CLI::App &app);    ///< the paper's method beside ours
void addFitOdds(CLI::App &app);      ///< weights of the final decision
} // namespace bole::apps
