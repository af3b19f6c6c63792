// SPDX-License-Identifier: GPL-2.0-or-later
// bole compare: our tracker against ViSP's edge trackers on the same frames, model and first pose.
#include "lab_commands.h"
#include "support/text.h"

#include "baseline/comparison.h"
#include "progress.h"
#include <bole/cylinder.h>
#include <bole/output_folder.h>
#include <bole/vpMbTrunkTracker.h>

#include <cstdio>
#include <filesystem>
#include <fmt/ranges.h>
#include <initializer_list>
#include <iterator>
#include <memory>

namespace bole::apps
{
namespace
{
namespace fs = std::filesystem;

struct CompareArguments
{
  std::string sequence, out, settings;
  bool has_video = true, has_basin = false, has_faults = false, is_quick = false, is_quiet = false;
  double far_m = 25;
};

constexpr double kModelRange = 25; ///< trunks that come as near to the camera are in the model [m]
constexpr TrackerKind kVisp[] = {TrackerKind::visp_edge, TrackerKind::visp_generic_edge,
                                 TrackerKind::visp_generic_edge_klt};

TestFlight readFlight(const std::string &path)
{
  if (fs::exists(fs::path(path) / "cube_and_cylinder.cao"))
    return readCubeFlight(path);
  return readAslFlight(path);
}

/// The steps of a comparison, for the bar.
class Steps
{
public:
  explicit Steps(const CompareArguments &arguments)
      : m_is_quiet(arguments.is_quiet), m_progress(countOf(arguments), stderr, "step")
  {
  }
  void begin(const std::string &what)
  {
    if (!m_is_quiet)
      m_progress.update(m_begun, what);
    ++m_begun;
  }

private:
  static std::size_t countOf(const CompareArguments &arguments)
  {
    const std::size_t sweeps = arguments.is_quick ? 0 : 3 * std::size(kVisp);
    return sweeps + 1 + (arguments.has_basin ? 2 * (std::size(kVisp) + 1) : 0) + (arguments.has_faults ? 1 : 0);
  }
  bool m_is_quiet;
  std::size_t m_begun = 0;
  Progress m_progress;
};

EdgeSettings bestOf(const std::vector<SweepResult> &sweeps, TrackerKind kind, Help help)
{
  for (const SweepResult &sweep : sweeps)
    if (sweep.kind == kind && sweep.help == help)
      return sweep.best;
  return {};
}

Contender ours(const CompareArguments &arguments, Help help)
{
  EdgeSettings settings;
  settings.far_m = arguments.far_m;
  return Contender(TrackerKind::trunk, help, settings, arguments.settings);
}

/// ViSP's trackers at their best settings, each with all of \p helps; ours alone and with a prior.
std::vector<Contender> contendersOf(const CompareArguments &arguments, const std::vector<SweepResult> &sweeps,
                                    std::initializer_list<Help> helps)
{
  std::vector<Contender> contenders;
  for (const TrackerKind kind : kVisp)
    for (const Help help : helps)
      contenders.emplace_back(kind, help, bestOf(sweeps, kind, help));
  for (const Help help : {Help::alone, Help::prior})
    contenders.push_back(ours(arguments, help));
  return contenders;
}

void compareAll(const CompareArguments &arguments, const TestFlight &flight, const std::string &cao, Steps &steps,
                ComparisonReport &report)
{
  const auto helps = {Help::alone, Help::prior, Help::reinitialised};
  for (const TrackerKind kind : kVisp)
    for (const Help help : helps) {
      if (interrupted())
        return;
      if (arguments.is_quick)
        continue;
      steps.begin(fmt::format("settings of {}, {}", toString(kind), toString(help)));
      report.sweeps.push_back(sweep(flight, cao, kind, help));
    }
  std::vector<Contender> contenders = contendersOf(arguments, report.sweeps, helps);
  steps.begin(fmt::format("{} trackers over {} frames", contenders.size(), flight.frames.size()));
  report.scores = compare(flight, cao, contenders);

  std::vector<Contender> timed;
  EdgeSettings edge = bestOf(report.sweeps, TrackerKind::visp_generic_edge, Help::prior);
  edge.far_m = arguments.far_m;
  timed.emplace_back(TrackerKind::visp_generic_edge, Help::truth, edge);
  timed.push_back(ours(arguments, Help::truth));
  report.timing = compare(flight, cao, timed);
}

void measureBasin(const CompareArguments &arguments, const TestFlight &flight, const std::string &cao, Steps &steps,
                  ComparisonReport &report)
{
  BasinOptions options;
  options.min_trunks = std::min(2, int(flight.trunks.size()));
  options.range_m = arguments.far_m;
  for (const bool has_clutter : {true, false}) {
    for (const TrackerKind kind : kVisp) {
      if (interrupted())
        return;
      steps.begin(fmt::format("basin of {}{}", toString(kind), has_clutter ? "" : ", without clutter"));
      BasinRow best;
      double best_sum = -1;
      for (const int range : {8, 16, 32}) { // the range that answers most steps right
        EdgeSettings settings = bestOf(report.sweeps, kind, Help::alone);
        settings.range = range;
        Contender contender(kind, Help::alone, settings);
        const BasinRow row = basin(flight, cao, contender, has_clutter, options);
        double sum = 0;
        for (const double share : row.success)
          sum += share;
        if (sum > best_sum)
          best_sum = sum, best = row;
      }
      report.basin.push_back(best);
    }
    steps.begin(fmt::format("basin of {}{}", toString(TrackerKind::trunk), has_clutter ? "" : ", without clutter"));
    Contender contender = ours(arguments, Help::alone);
    report.basin.push_back(basin(flight, cao, contender, has_clutter, options));
  }
}

void measureFaults(const CompareArguments &arguments, const TestFlight &flight, const std::string &cao, Steps &steps,
                   ComparisonReport &report)
{
  std::vector<Contender> contenders = contendersOf(arguments, report.sweeps, {Help::alone, Help::prior});
  steps.begin("faults");
  report.faults = faults(flight, cao, contenders);
}

void run(const CompareArguments &arguments)
{
  const TestFlight flight = readFlight(arguments.sequence);
  const OutputFolder folder(arguments.out, {"compare.json", "truth.cao", "compare.mp4"});
  const std::vector<Cylinder> model = flight.trunksWithin(kModelRange);
  if (model.empty())
    throw badValue("{}: no trunk within {:g} m", arguments.sequence, kModelRange);
  const std::string cao = (fs::path(arguments.out) / "truth.cao").string();
  writeCao(cao, model, "the trunks of " + flight.name + " as they are");

  ComparisonReport report;
  report.sequence = flight.name;
  report.command = fmt::format("bole {}", fmt::join(g_command_line.begin() + 1, g_command_line.end(), " "));
  report.frames = int(flight.frames.size());
  report.trunks = int(model.size());
  report.limits = flight.limits;
  endAtInterrupt();
  {
    Steps steps(arguments);
    compareAll(arguments, flight, cao, steps, report);
    if (arguments.has_basin && !interrupted())
      measureBasin(arguments, flight, cao, steps, report);
    if (arguments.has_faults && !interrupted())
      measureFaults(arguments, flight, cao, steps, report);
  }
  if (!arguments.is_quiet)
    std::fputs(toTable(report).c_str(), stdout);
  writeFile(arguments.out + "/compare.json", toJson(report));
  if (arguments.has_video && !interrupted())
    writeComparisonVideo((fs::path(arguments.out) / "compare.mp4").string(), flight, cao, report.scores);
  if (interrupted()) {
    fmt::print(stderr, "bole: interrupted: what was compared until then is in {}\n", arguments.out);
    endWith(ExitCode::interrupted);
  }
}
} // namespace

void addCompare(CLI::App &app)
{
  const auto arguments = std::make_shared<CompareArguments>();
  CLI::App *command = app.add_subcommand("compare", "Compare vpMbTrunkTracker with ViSP's edge trackers on one flight");
  command
      ->add_option("SEQUENCE", arguments->sequence,
                   "EuRoC/ASL folder with ground truth and trees.csv, or the folder `mbt` of visp-images-data")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("-o,--output", arguments->out, "Folder for the results")->required();
  command->add_flag("--basin", arguments->has_basin, "Also: right answers against the size of a yaw step");
  command->add_flag("--faults", arguments->has_faults, "Also: black, noisy, smeared, frozen and wrong-size frames");
  command->add_flag("--quick", arguments->is_quick,
                    "ViSP's trackers at the settings of its tutorials, without the sweep");
  command->add_option("--settings", arguments->settings, "XML settings of our tracker (models/*.xml)")
      ->check(CLI::ExistingFile);
  command->add_option("--far", arguments->far_m, "Range up to which our tracker uses trunks [m]")
      ->check(CLI::Range(0.5, 100.0))
      ->capture_default_str();
  command->add_flag("!--no-video", arguments->has_video, "Write no compare.mp4");
  command->add_flag("-q,--quiet", arguments->is_quiet, "No table and no progress");
  command->footer(
      "Every tracker gets the same frames in the same process, frame by frame, the true model (OUT/truth.cao) and\n"
      "the true first pose. ViSP's settings are swept on the flight itself, for each tracker and help; the best are "
      "used.\n"
      "Prints the table and writes OUT/compare.json and compare.mp4 (the trackers with a prior, side by side).\n"
      "apps/campaign/figures.py OUT draws the curves.\n"
      "Examples:\n"
      "  bole compare data/park-forward -o run/compare --basin --faults\n"
      "  bole compare /usr/share/visp-images-data/ViSP-images/mbt -o run/cube --settings models/cylinder.xml");
  command->callback([arguments] { run(*arguments); });
}
} // namespace bole::apps
