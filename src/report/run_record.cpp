// SPDX-License-Identifier: GPL-2.0-or-later
#include "report/run_record.h"

#include "evaluation/trajectory_metrics.h"
#include "geometry/failure.h"
#include "input/csv_reader.h"
#include "input/recorded_source.h"
#include "output/summary_json.h"
#include "output/trunks_csv.h"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace bole
{
namespace
{
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// The picture views/ID.jpg of \p run; empty where there is none, or something else: a link may lead out of the folder.
std::string viewOf(const fs::path &run, int id)
{
  constexpr std::size_t kMostBytes = 16'000'000;
  const fs::path folder = run / "views", path = folder / fmt::format("{}.jpg", id);
  if (!fs::is_directory(fs::symlink_status(folder)) || !fs::is_regular_file(fs::symlink_status(path)))
    return {};
  const std::string bytes = readWholeFile(path.string(), kMostBytes);
  return bytes.rfind("\xFF\xD8\xFF", 0) == 0 ? bytes : "";
}

std::string textOf(const Json &json, const char *key)
{
  return json.contains(key) && json[key].is_string() ? json[key].get<std::string>() : "";
}

void readSummaryInto(RunRecord &run, const std::string &path)
{
  const Json json = readSummary(path);
  if (!json.contains("input") || !json.contains("facts"))
    throw badValue("{}: is no summary of a run", path);
  try {
    run.input = textOf(json["input"], "source");
    run.sha256 = textOf(json["input"], "sha256");
    run.note = textOf(json["input"], "note");
    run.working_folder = textOf(json, "working_folder");
    run.command = json.value("command", run.command);
    run.facts = json.value("facts", run.facts);
    run.doubts = json.value("doubts", run.doubts);
    run.versions = json.value("versions", run.versions);
    run.is_trusted = json.value("trusted", true);
    run.has_ranges = json.value("ranges", true);
    for (const Json &sensor : json.value("sensors", Json::array()))
      run.sensors.push_back(
          {textOf(sensor, "sensor"), textOf(sensor, "kind"), sensor.value("since_s", 0.0), textOf(sensor, "text")});
  }
  catch (const Json::exception &error) {
    throw badValue("{}", faultOf(path, error));
  }
}

/// timing.csv: frame, timestamp, the stages, total, and the age of live frames.
TimingTable readTiming(const std::string &path)
{
  TimingTable timing;
  CsvReader csv(path, {3, ',', "frame,timestamp [s]"});
  const std::vector<std::string> &names = csv.header();
  const auto total = static_cast<std::size_t>(std::find(names.begin(), names.end(), "total [ms]") - names.begin());
  if (total == names.size())
    throw badValue("{}: has no column \"total [ms]\"", path);
  for (std::size_t i = 2; i < total; ++i)
    timing.stages.push_back(names[i].substr(0, names[i].find(" [")));
  while (csv.next()) {
    FrameTiming frame;
    frame.index = static_cast<std::size_t>(csv.integer(0, "frame"));
    for (std::size_t i = 2; i < total; ++i)
      frame.stages_ms.push_back(csv.number(i, "stage"));
    frame.total_ms = csv.number(total, "total");
    timing.frames.push_back(frame);
  }
  return timing;
}

/// Moves the truth into the world of the run, as pictures of both want it.
void readTruthInto(RunRecord &run, const std::string &sequence)
{
  const AslSource source(sequence);
  if (source.truth().empty())
    return;
  run.evaluation = evaluate(run.folder, sequence);
  std::vector<PosePair> pairs = pairPoses(run.smoothed, source.truth());
  for (PosePair &pair : pairs)
    std::swap(pair.estimate, pair.truth);
  const WorldReference reference = readReference(run.folder + "/summary.json");
  const bool is_scaled = reference.scale != ScaleSource::odometry;
  const PlanarTransform to_run = align(pairs, is_scaled ? Alignment::xy_yaw_scale : Alignment::xy_yaw);
  for (const PosePair &pair : pairs)
    run.truth.push_back({pair.stamp_ns, to_run * pair.estimate});
  run.truth_trunks = readTruthTrunks(sequence);
  for (TruthTrunk &trunk : run.truth_trunks) {
    trunk.xy = to_run * trunk.xy;
    trunk.radius *= to_run.scale;
  }
}
} // namespace

RunRecord readRun(const std::string &folder, const std::string &sequence)
{
  RunRecord run;
  run.folder = folder;
  readSummaryInto(run, folder + "/summary.json");
  for (const char *video : {"overlay.mp4", "saliency.mp4"})
    if (fs::exists(folder + "/" + video))
      run.videos.push_back(video);
  run.trunks = readTrunks(folder + "/trunks.csv");
  for (const TrunkRecord &hypothesis : readTrunks(folder + "/hypotheses.csv"))
    run.trunks.push_back(hypothesis);
  for (const TrunkRecord &trunk : run.trunks)
    if (std::string jpeg = viewOf(folder, trunk.id); !jpeg.empty())
      run.views_jpeg[trunk.id] = std::move(jpeg);
  run.smoothed = readTumTrajectory(folder + "/trajectory.tum");
  run.online = readTumTrajectory(folder + "/trajectory_online.tum");
  run.trace = readTrace(folder);
  run.timing = readTiming(folder + "/timing.csv");
  if (run.has_ranges && !sequence.empty())
    readTruthInto(run, sequence);
  return run;
}
} // namespace bole
