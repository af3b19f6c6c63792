// SPDX-License-Identifier: GPL-2.0-or-later
// What each step of the pipeline gives: a Markdown table of recall, precision and errors with one step taken away at a
// time. Usage: benchmark_ablation SEQUENCE... (folders with truth; the rendered flights where none is given).
#include "support/rendered_flights.h"

#include <bole/input/asl_source.h>
#include <bole/output/evaluation.h>
#include <bole/output/trajectory_writer.h>
#include <bole/output/trunks_csv.h>
#include <bole/pipeline/config.h>
#include <bole/pipeline/pipeline.h>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

namespace
{
using namespace bole;

struct Step
{
  const char *name;
  std::vector<std::string> settings; ///< as those of bole track --set
};

const std::vector<Step> kSteps = {
    {"everything (default)", {}},
    {"saliency off", {"flow.use_saliency=false"}},
    {"saliency by EM alone", {"saliency.use_translation=false"}},
    {"points off", {"flow.use_points=false"}},
    {"gyro's bias not learnt", {"gyro.bias_sigma=0", "gyro.bias_walk=0"}},
    {"upright trunks (lean off)", {"smoothing.prior_lean_sigma=0.0001"}},
    {"detector: foreground not asked", {"detection.foreground_min=0"}},
    {"detector: agreement and inliers not asked", {"detection.agreement_min=0", "detection.inliers_min=0"}},
    {"detector: range not asked", {"detection.range_sigma_max=1", "detection.parallax_min=0"}},
    {"odds not asked before confirmation", {"map.confirm_evidence=-20", "map.doubt_candidate=-50", "map.doubt_confirmed=-50"}},
    {"saliency inside a trunk not asked", {"map.near_range=0"}},
    {"merging off", {"map.merge_distance=0"}},
    {"scan off: minimised from the prediction", {"tracking.scan=false"}},
    {"blurred minimum and maximum (Eq. 3)", {"gradient.split=true", "energy.form=paper"}},
};

Evaluation fly(const std::string &sequence, const Step &step)
{
  PipelineOptions options;
  for (const std::string &setting : step.settings)
    setOption(setting, options);
  AslSource source(sequence);
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
  const std::string run = std::filesystem::temp_directory_path() / "bole_ablation";
  std::filesystem::create_directories(run);
  writeTrajectory(run + "/trajectory.tum", trajectory);
  writeTrunks(run + "/trunks.csv", pipeline.map());
  return evaluate(run, sequence);
}

void print(const std::string &sequence)
{
  std::printf("\n%s\n\n| step | recall | precision | duplicates | position, aligned: median / RMSE [m] | NEES/2 | radius "
              "RMSE [m] | ATE [m] |\n|---|---|---|---|---|---|---|---|\n",
              std::filesystem::path(sequence).filename().c_str());
  constexpr auto kAligned = static_cast<std::size_t>(Alignment::xy_yaw);
  for (const Step &step : kSteps) {
    const Evaluation evaluation = fly(sequence, step);
    const TrunkMetrics &trunks = evaluation.trunks.value();
    std::printf("| %s | %.2f (%zu of %zu) | %.2f | %.2f | %.2f / %.2f | %.1f | %.3f | %.3f |\n", step.name, trunks.recall,
                trunks.all.found, trunks.all.expected, trunks.precision, trunks.duplicates, trunks.all.median[kAligned],
                trunks.all.rmse[kAligned], trunks.all.nees_half, trunks.all.radius_rmse,
                evaluation.smoothed.absolute[kAligned].ate);
    std::fflush(stdout);
  }
}
} // namespace

int main(int argc, char **argv)
{
  try {
    for (const std::string &sequence : bole::test::flightsOf(argc, argv))
      print(sequence);
  }
  catch (const std::exception &error) {
    std::fprintf(stderr, "benchmark_ablation: %s\n", error.what());
    return 1;
  }
  return 0;
}
