// SPDX-License-Identifier: GPL-2.0-or-later
// bole evaluate: a finished run against the ground truth of its sequence.
#include "commands.h"
#include "data_files.h"

#include "output/atomic_file.h"
#include <bole/evaluation.h>

#include <cstdio>
#include <memory>
#include <string>

namespace bole::apps
{
void addEvaluate(CLI::App &app)
{
  struct Arguments
  {
    std::string run, sequence;
    EvaluationOptions options;
    bool is_verbose = false;
  };
  const auto arguments = std::make_shared<Arguments>();
  CLI::App *command = app.add_subcommand("evaluate", "Compare a run with the ground truth of its sequence");
  command->add_option("RUN", arguments->run, "Folder written by `bole track`")->required();
  command
      ->add_option("SEQUENCE", arguments->sequence,
                   "EuRoC/ASL folder with ground truth (and trees.csv), or another run to be "
                   "compared with")
      ->transform(findSequence)
      ->required();
  command->add_flag("-v,--verbose", arguments->is_verbose, "List every match, miss and false positive");
  command->add_flag("--align-time", arguments->options.align_time,
                    "Shift the run's stamps so that its motion fits: for live runs, whose stamps are "
                    "the drone's");
  command->footer("Prints a table and writes RUN/evaluation.json.\n"
                  "Examples:\n"
                  "  bole evaluate run/park data/park-forward --verbose\n"
                  "  bole evaluate run/live data/park-forward --align-time\n"
                  "  bole evaluate run/live run/park --align-time");
  command->callback([arguments] {
    const Evaluation evaluation = evaluate(arguments->run, arguments->sequence, arguments->options);
    std::fputs(toTable(evaluation, arguments->is_verbose).c_str(), stdout);
    writeAtomically(arguments->run + "/evaluation.json", toJson(evaluation));
  });
}
} // namespace bole::apps
