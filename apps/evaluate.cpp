// SPDX-License-Identifier: GPL-2.0-or-later
// bole evaluate: a finished run against the ground truth of its sequence.
#include "commands.h"
#include "data_files.h"

#include "input/atomic_file.h"
#include <bole/evaluation.h>

#include <cstdio>
#include <memory>
#include <string>

namespace bole::apps
{
void addEvaluate(CLI::App &app)
{
  struct EvaluateArguments
  {
    std::string run, sequence, json;
    EvaluationOptions options;
    bool is_verbose = false, is_quiet = false;
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
  command->add_flag("--align-time", arguments->options.align_time,
                    "Shift the run's stamps so that its motion fits: for live runs, whose stamps are "
                    "the drone's");
  command->footer("Prints a table and writes all figures as JSON. \"-\" and null: there was nothing to measure.\n"
                  "Examples:\n"
                  "  bole evaluate run/park data/park-forward --verbose\n"
                  "  bole evaluate run/live data/park-forward --align-time --json live.json\n"
                  "  bole evaluate run/live run/park --align-time");
  command->callback([arguments] {
    const Evaluation evaluation = evaluate(arguments->run, arguments->sequence, arguments->options);
    if (!arguments->is_quiet)
      std::fputs(toTable(evaluation, arguments->is_verbose).c_str(), stdout);
    writeAtomically(arguments->json.empty() ? arguments->run + "/evaluation.json" : arguments->json,
                    toJson(evaluation));
  });
}
} // namespace bole::apps
