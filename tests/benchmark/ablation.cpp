// SPDX-License-Identifier: GPL-2.0-or-later
// What each step of the pipeline gives: a Markdown table of recall, precision and errors with one step taken away at a
// time. Usage: benchmark_ablation SEQUENCE... (folders with truth; the rendered flights where none is given).
#include "support/rendered_flights.h"

#include "geometry/median.h"
#include "input/asl_source.h"
#include "output/trajectory_writer.h"
#include "output/trunks_csv.h"
#include "pipeline/stage_options.h"
#include <bole/evaluation.h>
#include <bole/pipeline.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <string>
#include <unistd.h>
#include <vector>

namespace
{
using namespace bole;

struct Step
{
  const char *name;
  std::function<void(StageOptions &)> take_away;
};

const std::vector<Step> kSteps = {
    {"everything (default)", [](StageOptions &) {}},
    {"saliency off", [](StageOptions &o) { o.flow.use_saliency = false; }},
    {"saliency by EM alone", [](StageOptions &o) { o.saliency.use_translation = false; }},
    {"points off", [](StageOptions &o) { o.flow.use_points = false; }},
    {"gyro's bias not learnt", [](StageOptions &o) { o.points.gyro.bias_sigma = o.points.gyro.bias_walk = 0; }},
    {"upright trunks (lean off)", [](StageOptions &o) { o.smoothing.prior_lean_sigma = 0.0001; }},
    {"detector: foreground not asked", [](StageOptions &o) { o.detection.foreground_min = 0; }},
    {"detector: agreement and inliers not asked",
     [](StageOptions &o) { o.detection.agreement_min = o.detection.inliers_min = 0; }},
    {"detector: range not asked",
     [](StageOptions &o) {
       o.detection.range_sigma_max = 1;
       o.detection.parallax_min = 0;
     }},
    {"log-odds not asked before confirmation",
     [](StageOptions &o) {
       o.map.confirm_odds = -20;
       o.map.reject_candidate = o.map.reject_confirmed = -50;
     }},
    {"saliency inside a trunk not asked", [](StageOptions &o) { o.map.near_range = 0; }},
    {"points behind a trunk not asked", [](StageOptions &o) { o.map.through_range = 0; }},
    {"merging off", [](StageOptions &o) { o.map.merge_distance = 0; }},
    {"scan off: minimised from the prediction", [](StageOptions &o) { o.tracking.scan = false; }},
};

Evaluation fly(const std::string &sequence, const Step &step)
{
  AslSource source(sequence);
  StageOptions options = stageOptions(Options(), source.camera());
  step.take_away(options);
  Pipeline pipeline(source.camera(), source.bMc(), options);
  for (;;) {
    Frame frame;
    if (!source.next(frame))
      break;
    pipeline.process(frame);
  }
  pipeline.finish();
  Trajectory trajectory;
  for (const auto &pose : pipeline.smoothedTrajectory())
    trajectory.push_back({pose.stamp_ns, pose.wMb});
  const std::string run = std::filesystem::temp_directory_path() / ("bole_ablation_" + std::to_string(getpid()));
  std::filesystem::create_directories(run);
  writeTrajectory(run + "/trajectory.tum", trajectory);
  writeTrunks(run + "/trunks.csv", pipeline.map());
  const Evaluation evaluation = evaluate(run, sequence);
  std::filesystem::remove_all(run);
  return evaluation;
}

constexpr auto kAligned = static_cast<std::size_t>(Alignment::xy_yaw);

/// The trunks of many flights as if they were one's; medians over the flights of what has no trunks to count.
class Pool
{
public:
  void add(const Evaluation &evaluation)
  {
    const TrunkMetrics &trunks = evaluation.trunks.value();
    m_found += static_cast<double>(trunks.all.found);
    m_expected += static_cast<double>(trunks.all.expected);
    const double confirmed = static_cast<double>(trunks.confirmed);
    m_confirmed += confirmed;
    m_true += static_cast<double>(trunks.matches.size());
    if (confirmed > 0)
      m_duplicates += trunks.duplicates * confirmed;
    const double matches = static_cast<double>(trunks.all.matches);
    m_matches += matches;
    if (matches > 0)
      m_squares += matches * trunks.all.rmse[kAligned] * trunks.all.rmse[kAligned];
    for (const TrunkMatch &match : trunks.matches)
      if (!std::isnan(match.radius_error))
        m_radius_squares += match.radius_error * match.radius_error;
    for (const TrunkMatch &match : trunks.matches)
      m_errors.push_back(match.error[kAligned]);
    if (matches > 0)
      m_nees.push_back(trunks.all.nees_half);
    m_ate.push_back(evaluation.smoothed.absolute[kAligned].ate);
  }
  void print(const char *name) const
  {
    std::printf("| %s | %.2f (%.0f of %.0f) | %.2f | %.2f | %.2f / %.2f | %.1f | %.3f | %.3f |\n", name,
                m_found / m_expected, m_found, m_expected, m_true / m_confirmed, m_duplicates / m_confirmed,
                medianOf(m_errors), std::sqrt(m_squares / m_matches), medianOf(m_nees),
                std::sqrt(m_radius_squares / m_matches), medianOf(m_ate));
  }

private:
  double m_found = 0, m_expected = 0, m_confirmed = 0, m_true = 0, m_duplicates = 0, m_matches = 0;
  double m_squares = 0, m_radius_squares = 0;
  std::vector<double> m_errors, m_nees, m_ate;
};

void printHeader(const std::string &title)
{
  std::printf(
      "\n%s\n\n| step | recall | precision | duplicates | position, aligned: median / RMSE [m] | NEES/2 | radius "
      "RMSE [m] | ATE [m] |\n|---|---|---|---|---|---|---|---|\n",
      title.c_str());
}

void flyAll(const std::vector<std::string> &sequences)
{
  std::vector<Pool> pools(kSteps.size());
  for (const std::string &sequence : sequences) {
    printHeader(std::filesystem::path(sequence).filename());
    for (std::size_t i = 0; i < kSteps.size(); ++i) {
      const Evaluation evaluation = fly(sequence, kSteps[i]);
      Pool one;
      one.add(evaluation);
      one.print(kSteps[i].name);
      std::fflush(stdout);
      pools[i].add(evaluation);
    }
  }
  if (sequences.size() < 2)
    return;
  printHeader("all " + std::to_string(sequences.size()) + " flights (NEES/2 and ATE: medians of the flights)");
  for (std::size_t i = 0; i < kSteps.size(); ++i)
    pools[i].print(kSteps[i].name);
}
} // namespace

int main(int argc, char **argv)
{
  try {
    flyAll(bole::test::flightsOf(argc, argv));
  }
  catch (const std::exception &error) {
    std::fprintf(stderr, "benchmark_ablation: %s\n", error.what());
    return 1;
  }
  return 0;
}
