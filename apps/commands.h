// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The subcommands of `bole`. Each adds itself to the command line with its options and its callback; a
/// callback throws vpException for a user's mistake, which main() prints as one line.

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace bole::apps
{
/// A number in [\p low, \p high]; unlike CLI::Range not NaN, and not -1 as the largest unsigned number.
inline CLI::Validator within(double low, double high)
{
  return CLI::Validator(
      [low, high](const std::string &text) {
        double value = 0;
        const bool is_good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
        return is_good
                   ? std::string()
                   : text + ", must be in [" + CLI::detail::to_string(low) + ", " + CLI::detail::to_string(high) + "]";
      },
      "", "");
}

/// What the process returns; `bole --help` tells the same.
enum class ExitCode
{
  good = 0,
  error = 1,        ///< a mistake of the user's, or a file that cannot be read or written
  usage = 2,        ///< unknown commands and options
  doubtful = 3,     ///< done, but the result is not to be trusted
  interrupted = 130 ///< ended early; what was known is kept
};
/// Ends a command that has done and said all, with \p code.
[[noreturn]] inline void endWith(ExitCode code) { throw CLI::RuntimeError(static_cast<int>(code)); }

/// The program and its arguments, set by main(): what a run is made with.
inline std::vector<std::string> g_command_line;

void addTrack(CLI::App &app);
void addEvaluate(CLI::App &app); ///< a run against the ground truth
void addReport(CLI::App &app);   ///< the page about a run
void addExport(CLI::App &app);   ///< maps for other tools
void addOptions(CLI::App &app);  ///< every option with its range and effect
void addLocalise(CLI::App &app); ///< a flight on the map of an earlier one
void addFollow(CLI::App &app);   ///< a video in a known map
void addRecord(CLI::App &app);   ///< a live flight to disk
void addGraph(CLI::App &app);    ///< the graph of a run
void addSolve(CLI::App &app);    ///< the optimum of a saved graph
/// Writes man pages and completions of all other commands; \p version goes into their foot.
void addDocumentation(CLI::App &app, const std::string &version);
} // namespace bole::apps
