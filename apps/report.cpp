// SPDX-License-Identifier: GPL-2.0-or-later
// bole report: the page about a run, written anew.
#include "commands.h"
#include "data_files.h"

#include "report/report_page.h"

#include <cstdio>
#include <memory>
#include <string>

namespace bole::apps
{
void addReport(CLI::App &app)
{
  struct ReportArguments
  {
    std::string run, sequence;
  };
  const auto arguments = std::make_shared<ReportArguments>();
  CLI::App *command = app.add_subcommand("report", "Write the page about a run, RUN/report.html");
  command->add_option("RUN", arguments->run, "Folder written by `bole track`")->required();
  command->add_option("SEQUENCE", arguments->sequence, "EuRoC/ASL folder with ground truth, to be drawn beside")
      ->transform(findSequence);
  command->footer("One file that needs no network: map with zoom, trunks with their best view and their figures over "
                  "time, time line,\ntrajectory, cost, what to do next. `bole track` writes it too.\n"
                  "Examples:\n"
                  "  bole report run\n"
                  "  bole report run data/park-forward");
  command->callback([arguments] {
    writeReport(arguments->run, arguments->sequence);
    std::printf("%s/report.html\n", arguments->run.c_str());
  });
}
} // namespace bole::apps
