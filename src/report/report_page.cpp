// SPDX-License-Identifier: GPL-2.0-or-later
#include "report/report_page.h"

#include "evaluation/trajectory_metrics.h"
#include "geometry/failure.h"
#include "input/atomic_file.h"
#include "input/recorded_source.h"
#include "input/regular_file.h"
#include "output/summary_json.h"
#include "output/trunks_csv.h"
#include "report_template.h" // made of page.html

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

extern "C" {
#include <libavutil/base64.h>
}

namespace bole
{
namespace
{
using Json = nlohmann::json;

namespace fs = std::filesystem;
/// Reads the picture views/ID.jpg of \p run. It is empty where there is none, and where a link stands in its place,
/// which may lead out of the folder.
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
    run.scale_sigma =
        json.contains("scale_sigma") && json["scale_sigma"].is_number() ? json["scale_sigma"].get<double>() : 0;
    for (const Json &sensor : json.value("sensors", Json::array()))
      run.sensors.push_back(
          {textOf(sensor, "sensor"), textOf(sensor, "kind"), sensor.value("since_s", 0.0), textOf(sensor, "text")});
  }
  catch (const Json::exception &error) {
    throw badValue("{}", faultOf(path, error));
  }
}

/// Moves the truth into the world of the run, so that both can be drawn in one picture.
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

namespace
{
constexpr std::size_t kMostPoints = 400; // of a curve: a reader sees no more
constexpr std::size_t kMostSteps = 4000; // of a line on the map
constexpr std::size_t kEllipses = 30;    // of the trajectory

/// Returns \p jpeg as an address that holds the picture itself.
std::string asText(const std::string &jpeg)
{
  std::string text(AV_BASE64_SIZE(jpeg.size()), '\0'); // with a zero at its end
  av_base64_encode(text.data(), static_cast<int>(text.size()), reinterpret_cast<const std::uint8_t *>(jpeg.data()),
                   static_cast<int>(jpeg.size()));
  return "data:image/jpeg;base64," + std::string(text.c_str());
}

double secondsSince(const RunRecord &run, std::int64_t stamp_ns)
{
  return run.trace.frames.empty() ? 0 : 1e-9 * static_cast<double>(stamp_ns - run.trace.frames.front().stamp_ns);
}

/// Lists \p jsonOf of each of \p values, or of every n-th where there are more than \p most.
template <class Values, class JsonOf> Json thinned(const Values &values, std::size_t most, const JsonOf &jsonOf)
{
  Json list = Json::array();
  for (std::size_t i = 0; i < values.size(); i += values.size() / most + 1)
    list.push_back(jsonOf(values[i]));
  return list;
}

Json lineOf(const Trajectory &path)
{
  return thinned(path, kMostSteps, [](const StampedPose &pose) { return Json{pose.wMb.t.x(), pose.wMb.t.y()}; });
}

/// Lists the runs of frames for which \p kindOf is the same: [from s, to s, kind].
template <class KindOf> Json runsOf(const RunRecord &run, const KindOf &kindOf)
{
  const std::vector<FrameTrace> &frames = run.trace.frames;
  Json runs = Json::array();
  for (std::size_t i = 0, end = 0; i < frames.size(); i = end) {
    for (end = i + 1; end < frames.size() && kindOf(frames[end]) == kindOf(frames[i]);)
      ++end;
    runs.push_back({secondsSince(run, frames[i].stamp_ns),
                    secondsSince(run, frames[std::min(end, frames.size() - 1)].stamp_ns), kindOf(frames[i])});
  }
  return runs;
}

Json trunkJson(const RunRecord &run, const TrunkRecord &trunk)
{
  const Eigen::Matrix2d xy = trunk.covarianceXy();
  Json json = {{"id", trunk.id},
               {"status", toString(trunk.status)},
               {"x", trunk.xy.x()},
               {"y", trunk.xy.y()},
               {"radius", trunk.radius}};
  if (trunk.status != TrunkStatus::confirmed)
    return json;
  json.update({{"sigma", trunk.positionSigma()},
               {"radius_sigma", trunk.radiusSigma()},
               {"covariance", {xy(0, 0), xy(0, 1), xy(1, 1)}},
               {"lean_deg", std::atan(trunk.lean.norm()) * 180 / M_PI},
               {"views", trunk.observations},
               {"first", trunk.first_seen_s},
               {"last", trunk.last_seen_s},
               {"probability", trunk.probability}});
  if (const auto view = run.views_jpeg.find(trunk.id); view != run.views_jpeg.end())
    json["picture"] = asText(view->second);
  std::vector<TrunkTrace> views;
  std::vector<std::size_t> measured;
  for (const TrunkTrace &view : run.trace.views)
    if (view.id == trunk.id) {
      views.push_back(view);
      measured.push_back(view.frame);
    }
  json["curve"] = thinned(views, kMostPoints, [&](const TrunkTrace &view) {
    return Json{secondsSince(run, view.stamp_ns),
                view.range,
                view.range_sigma,
                view.radius,
                view.radius_sigma,
                view.xy.x(),
                view.xy.y(),
                view.xy_sigma.x(),
                view.xy_sigma.y()};
  });
  json["seen"] = runsOf(
      run, [&](const FrameTrace &frame) { return std::binary_search(measured.begin(), measured.end(), frame.index); });
  return json;
}

Json evaluationJson(const Evaluation &evaluation)
{
  const auto ate = [](const TrajectoryReport &report) { return report.absolute[indexOf(Alignment::xy_yaw)].ate; };
  Json json = {{"smoothed", ate(evaluation.smoothed)}};
  if (evaluation.online)
    json["online"] = ate(*evaluation.online);
  if (evaluation.odometry)
    json["odometry"] = ate(*evaluation.odometry);
  if (!evaluation.trunks)
    return json;
  const TrunkMetrics &trunks = *evaluation.trunks;
  const std::size_t matching = indexOf(trunks.matching);
  json["trunks"] = {{"recall", trunks.recall},
                    {"precision", trunks.precision},
                    {"found", trunks.all.found},
                    {"expected", trunks.all.expected},
                    {"confirmed", trunks.confirmed},
                    {"median_m", trunks.all.median[matching]},
                    {"radius_rmse_m", trunks.all.radius_rmse},
                    {"nees_half", trunks.all.nees_half},
                    {"matches", Json::array()}};
  for (const TrunkMatch &match : trunks.matches)
    json["trunks"]["matches"].push_back({{"id", match.estimate.id},
                                         {"truth_id", match.truth_id},
                                         {"error_m", match.error[matching]},
                                         {"radius_error_m", match.radius_error},
                                         {"truth_radius_m", match.truth_radius}});
  return json;
}

/// Lists the distance in the plane between the smoothed path and the truth: [s, m].
Json errorsOf(const RunRecord &run)
{
  if (run.smoothed.empty())
    return Json::array();
  std::size_t k = 0;
  return thinned(run.truth, kMostPoints, [&](const StampedPose &truth) {
    while (k + 1 < run.smoothed.size() && run.smoothed[k].stamp_ns < truth.stamp_ns)
      ++k;
    return Json{secondsSince(run, truth.stamp_ns), (run.smoothed[k].wMb.t - truth.wMb.t).head<2>().norm()};
  });
}

/// Adds what was known frame by frame.
void addFrames(Json &json, const RunRecord &run)
{
  const std::vector<FrameTrace> &frames = run.trace.frames;
  json["seconds"] = frames.empty() ? 0 : secondsSince(run, frames.back().stamp_ns);
  json["statuses"] = runsOf(run, [](const FrameTrace &frame) { return toString(frame.status); });
  json["places"] = thinned(frames, kMostPoints, [&](const FrameTrace &frame) {
    return Json{secondsSince(run, frame.stamp_ns), std::sqrt(std::max(0.0, frame.covariance_xy(0, 0))),
                std::sqrt(std::max(0.0, frame.covariance_xy(1, 1))), frame.place.z()};
  });
  json["ellipses"] = thinned(frames, kEllipses, [](const FrameTrace &frame) {
    return Json{frame.place.x(), frame.place.y(), frame.covariance_xy(0, 0), frame.covariance_xy(0, 1),
                frame.covariance_xy(1, 1)};
  });
  json["evidence"] = {{"side", GroundEvidence::kSide}, {"squares", Json::array()}};
  for (const auto &[middle, count] : run.trace.evidence.squares())
    json["evidence"]["squares"].push_back({middle.x(), middle.y(), count});
}

void addCost(Json &json, const RunRecord &run)
{
  const TimingTable &timing = run.timing;
  std::size_t frame = 0;
  json["costs"] = thinned(timing.frames, kMostPoints, [&](const FrameTiming &cost) {
    while (frame + 1 < run.trace.frames.size() && run.trace.frames[frame].index < cost.index)
      ++frame;
    return Json{run.trace.frames.empty() ? 0 : secondsSince(run, run.trace.frames[frame].stamp_ns), cost.total_ms};
  });
  json["stages"] = Json::array();
  for (std::size_t i = 0; i < timing.stages.size(); ++i)
    json["stages"].push_back({timing.stages[i], timing.medianStage_ms(i)});
  json["total_ms"] = timing.medianTotal_ms();
  json["total_95_ms"] = timing.percentile95_ms();
}
} // namespace

std::string reportJson(const RunRecord &run)
{
  Json json = {{"folder", run.folder},
               {"input", run.input},
               {"working_folder", run.working_folder},
               {"note", run.note},
               {"sha256", run.sha256},
               {"command", run.command},
               {"facts", run.facts},
               {"doubts", run.doubts},
               {"versions", run.versions},
               {"trusted", run.is_trusted},
               {"ranges", run.has_ranges},
               {"scale_sigma", run.scale_sigma},
               {"videos", run.videos},
               {"sensors", Json::array()},
               {"trunks", Json::array()},
               {"truth_trunks", Json::array()},
               {"smoothed", lineOf(run.smoothed)},
               {"online", lineOf(run.online)},
               {"truth", lineOf(run.truth)},
               {"errors", errorsOf(run)}};
  for (const SensorVerdict &verdict : run.sensors)
    json["sensors"].push_back(
        {{"sensor", verdict.sensor}, {"since_s", secondsSince(run, std::llround(1e9 * verdict.since_s))}});
  for (const TrunkRecord &trunk : run.trunks)
    json["trunks"].push_back(trunkJson(run, trunk));
  for (const TruthTrunk &trunk : run.truth_trunks)
    json["truth_trunks"].push_back({{"x", trunk.xy.x()}, {"y", trunk.xy.y()}, {"radius", trunk.radius}});
  json["camera"] = run.online.empty() ? Json{0, 0} : lineOf({run.online.back()})[0];
  json["evaluation"] = run.evaluation ? evaluationJson(*run.evaluation) : Json();
  addFrames(json, run);
  addCost(json, run);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string reportHtml(const RunRecord &run)
{
  std::string json = reportJson(run), page = kReportTemplate;
  for (std::size_t at = 0; (at = json.find('<', at)) != std::string::npos;) // no word of the run may end the script
    json.replace(at, 1, "\\u003c");
  const std::string place = "/*RUN*/";
  return page.replace(page.find(place), place.size(), json);
}

void writeReport(const std::string &run, const std::string &sequence)
{
  writeAtomically(run + "/report.html", reportHtml(readRun(run, sequence)));
}
} // namespace bole
