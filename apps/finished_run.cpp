// SPDX-License-Identifier: GPL-2.0-or-later
// What reads a finished run: bole evaluate, which compares it with the ground truth of its sequence; bole report, which
// writes the page about it anew; bole export, which writes its map and trajectory for other tools.
#include "commands.h"
#include "data_files.h"
#include "geometry/failure.h"

#include "exchange/exchange.h"
#include "input/atomic_file.h"
#include "report/report_page.h"
#include <bole/evaluation.h>

#include <algorithm>
#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <string>

namespace bole::apps
{
void addEvaluate(CLI::App &app)
{
  struct EvaluateArguments
  {
    std::string run, sequence, json;
    bool is_time_aligned = false, is_verbose = false, is_quiet = false;
  };
  const auto arguments = std::make_shared<EvaluateArguments>();
  CLI::App *command = app.add_subcommand("evaluate", "Compare a run with the ground truth of its sequence");
  command->add_option("RUN", arguments->run, "Folder written by `bole track`")->required();
  command
      ->add_option("SEQUENCE", arguments->sequence,
                   "EuRoC/ASL folder with ground truth (and trees.csv), or another run to be "
                   "compared with")
      ->transform(findSequence)
      ->required();
  command->add_flag("-v,--verbose", arguments->is_verbose, "List every match, miss and false positive");
  command->add_flag("-q,--quiet", arguments->is_quiet, "No table");
  command->add_option("--json", arguments->json, "File for all figures (default RUN/evaluation.json)");
  command->add_flag("--align-time", arguments->is_time_aligned,
                    "Shift the run's stamps so that its motion fits: for live runs, whose stamps are "
                    "the drone's");
  command->footer("Prints a table and writes all figures as JSON. \"-\" and null: there was nothing to measure.\n"
                  "Examples:\n"
                  "  bole evaluate run/park data/park-forward --verbose\n"
                  "  bole evaluate run/live data/park-forward --align-time --json live.json\n"
                  "  bole evaluate run/live run/park --align-time");
  command->callback([arguments] {
    const Evaluation evaluation = evaluate(arguments->run, arguments->sequence, arguments->is_time_aligned);
    if (!arguments->is_quiet)
      std::fputs(toTable(evaluation, arguments->is_verbose).c_str(), stdout);
    writeAtomically(arguments->json.empty() ? arguments->run + "/evaluation.json" : arguments->json,
                    toJson(evaluation));
  });
}

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

void addExport(CLI::App &app)
{
  struct ExportArguments
  {
    std::string run, format, output, origin;
  };
  const auto arguments = std::make_shared<ExportArguments>();
  CLI::App *command = app.add_subcommand("export", "Write the map of a run for other tools");
  std::vector<std::string> names;
  std::string table;
  for (const ExportFormat &format : kExportFormats) {
    names.emplace_back(format.name);
    table += fmt::format("  {:8} {:13} {}\n", format.name, format.file, format.what);
  }
  command->add_option("RUN", arguments->run, "Folder written by `bole track`")->required();
  command->add_option("FORMAT", arguments->format, "One of those below")->required()->check(CLI::IsMember(names));
  command->add_option("-o,--output", arguments->output, "File (colmap: folder) to write (default: in RUN, see below)");
  command->add_option("--origin", arguments->origin,
                      "geojson: LATITUDE,LONGITUDE of the world's origin and HEADING of its x axis, clockwise from "
                      "north [degrees]");
  command->footer("Formats and their files:\n" + table +
                  "Examples:\n"
                  "  bole export run cao\n"
                  "  bole export run geojson --origin 59.34,18.07,90 -o wood.geojson");
  command->callback([arguments] {
    std::optional<GeoOrigin> origin;
    if (!arguments->origin.empty()) {
      if (arguments->format != "geojson")
        throw badValue("--origin: {} has metres alone, must be geojson", arguments->format);
      origin = parseOrigin(arguments->origin);
    }
    const auto format = std::find_if(kExportFormats.begin(), kExportFormats.end(),
                                     [&](const ExportFormat &known) { return known.name == arguments->format; });
    const std::string file = arguments->output.empty() ? arguments->run + "/" + format->file : arguments->output;
    const std::string note = exportRun(arguments->run, arguments->format, file, origin);
    std::printf("%s\n", file.c_str());
    if (!note.empty())
      std::fprintf(stderr, "bole: %s\n", note.c_str());
  });
}
} // namespace bole::apps
