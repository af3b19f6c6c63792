// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The page about a run: one file that a browser opens without network.

#include "report/run_record.h"

#include <string>

namespace bole
{
/// What the page shows, as JSON: the script in page.html draws it.
std::string reportJson(const RunRecord &run);

/// page.html with reportJson() in it: what the run is worth, map, trunks, time line, trajectory, cost, how to repeat
/// it, what to do next.
std::string reportHtml(const RunRecord &run);

/// Writes RUN/report.html from what the folder \p run holds; \p sequence: ASL folder with the truth, or empty.
/// \throw vpException naming the file that is missing or faulty.
void writeReport(const std::string &run, const std::string &sequence);
} // namespace bole
