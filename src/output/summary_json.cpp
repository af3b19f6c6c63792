// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/summary_json.h"
#include "geometry/failure.h"
#include "geometry/median.h"
#include "geometry/names.h"
#include "input/atomic_file.h"
#include "input/regular_file.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

namespace bole
{
namespace
{
using Json = nlohmann::ordered_json;

Json median(std::vector<double> values) { return values.empty() ? Json() : Json(medianOf(std::move(values))); }

/// Counts the trunks by status and tells their medians; without \p has_ranges it leaves out all lengths.
Json trunksJson(const std::vector<TrunkRecord> &trunks, bool has_ranges)
{
  Json json;
  for (const auto status : {TrunkStatus::confirmed, TrunkStatus::candidate, TrunkStatus::lost, TrunkStatus::merged})
    json[toString(status)] =
        std::count_if(trunks.begin(), trunks.end(), [&](const TrunkRecord &trunk) { return trunk.status == status; });
  if (!has_ranges)
    return json;
  std::vector<double> radius, sigma, sigma_radius, observations;
  for (const TrunkRecord &trunk : trunks) {
    if (trunk.status != TrunkStatus::confirmed)
      continue;
    radius.push_back(trunk.radius);
    sigma.push_back(trunk.positionSigma());
    sigma_radius.push_back(trunk.radiusSigma());
    observations.push_back(trunk.observations);
  }
  json["median_of_confirmed"] = {{"radius_m", median(radius)},
                                 {"position_sigma_m", median(sigma)},
                                 {"radius_sigma_m", median(sigma_radius)},
                                 {"observations", median(observations)}};
  return json;
}

Json timingJson(const TimingTable &timing)
{
  Json json = {{"median_frame_ms", timing.medianTotal_ms()}, {"percentile95_frame_ms", timing.percentile95_ms()}};
  for (std::size_t i = 0; i < timing.stages.size(); ++i)
    json["median_stage_ms"][timing.stages[i]] = timing.medianStage_ms(i);
  if (const auto median = timing.age_ms(0.5))
    json["age_ms"] = {{"median", *median}, {"percentile99", *timing.age_ms(0.99)}, {"most", *timing.age_ms(1)}};
  return json;
}

Json framesJson(const std::map<FrameStatus, std::size_t> &frames)
{
  Json json;
  std::size_t all = 0;
  for (const auto status : {FrameStatus::ok, FrameStatus::stale, FrameStatus::corrupt, FrameStatus::missing,
                            FrameStatus::resized, FrameStatus::doubtful}) {
    const auto entry = frames.find(status);
    json[toString(status)] = entry == frames.end() ? 0 : entry->second;
    all += entry == frames.end() ? 0 : entry->second;
  }
  json["all"] = all;
  return json;
}

Json positiveOrNull(double value) { return value > 0 ? Json(value) : Json(); }
Json textOrNull(const std::string &text) { return text.empty() ? Json() : Json(text); }

Json inputJson(const RunSummary &summary)
{
  return {{"source", summary.input},
          {"bytes", summary.digest ? Json(summary.digest->bytes) : Json()},
          {"sha256", summary.digest ? Json(summary.digest->sha256) : Json()},
          {"camera_file", textOrNull(summary.camera_file)},
          {"odometry_file", textOrNull(summary.odometry_file)},
          {"odometry", summary.has_odometry},
          {"gyro", summary.has_gyro},
          {"note", textOrNull(summary.note)}};
}

Json motionJson(const RunSummary &summary)
{
  const bool has_ranges = summary.reference.has_ranges;
  return {{"duration_s", summary.duration_s},
          {"path_m", has_ranges ? Json(summary.path_m) : Json()},
          {"extent_m", has_ranges ? Json(summary.extent_m) : Json()},
          {"rotated_deg", summary.rotated_deg}};
}
} // namespace

std::string toJson(const RunSummary &summary)
{
  const PinholeCamera &camera = summary.camera;
  const Verdict verdict = judge(summary);
  Json json;
  json["complete"] = summary.is_complete;
  json["ended"] = summary.has_ended;
  json["trusted"] = verdict.is_trusted;
  json["facts"] = verdict.facts;
  json["doubts"] = verdict.doubts;
  json["command"] = summary.command;
  json["working_folder"] = textOrNull(summary.working_folder);
  json["versions"] = versions();
  json["input"] = inputJson(summary);
  json["camera"] = {{"width_px", camera.width},
                    {"height_px", camera.height},
                    {"fx_px", camera.fx},
                    {"fy_px", camera.fy},
                    {"cx_px", camera.cx},
                    {"cy_px", camera.cy},
                    {"known", summary.is_camera_known},
                    {"field_of_view_sigma_deg", positiveOrNull(summary.field_of_view_sigma_deg)}};
  json["preset"] = textOrNull(summary.preset);
  json["options"] = textOrNull(summary.options);
  json["scale"] = toString(summary.reference.scale);
  json["scale_sigma"] = positiveOrNull(summary.reference.scale_sigma);
  json["gravity"] = toString(summary.reference.gravity);
  json["gravity_sigma_rad"] = positiveOrNull(summary.reference.gravity_sigma);
  json["ranges"] = summary.reference.has_ranges;
  json["motion"] = motionJson(summary);
  json["frames"] = framesJson(summary.frames);
  json["gaps"] = Json::array();
  for (const PictureGap &gap : summary.gaps)
    json["gaps"].push_back({{"begin_s", gap.begin_s}, {"length_s", gap.length_s}});
  json["calibration"] = Json::array();
  for (const CalibratedConstant &constant : summary.calibration)
    json["calibration"].push_back({{"name", constant.name},
                                   {"value", constant.value},
                                   {"sigma", constant.sigma},
                                   {"used", constant.used},
                                   {"text", constant.text}});
  json["sensors"] = Json::array();
  for (const SensorVerdict &sensor : summary.sensors)
    json["sensors"].push_back(
        {{"sensor", sensor.sensor}, {"kind", sensor.kind}, {"since_s", sensor.since_s}, {"text", sensor.text}});
  json["trunks"] = trunksJson(summary.trunks, summary.reference.has_ranges);
  json["timing"] = timingJson(summary.timing);
  for (const auto &[name, value] : summary.figures)
    json["figures"][name] = value;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

namespace
{
template <typename Source> Source sourceOf(const std::string &path, const Json &json, const char *key, Source last)
{
  if (!json.contains(key)) // an earlier version wrote none
    return static_cast<Source>(0);
  if (const auto source = valueNamed(json.value(key, ""), last))
    return *source;
  throw badValue("{}: {} = \"{}\", is no known source", path, key, json.value(key, ""));
}

double numberOrZero(const Json &json, const char *key)
{
  return json.contains(key) && json[key].is_number() ? json[key].get<double>() : 0;
}

} // namespace

nlohmann::ordered_json readSummary(const std::string &path)
{
  constexpr std::size_t kMostBytes = 16'000'000;
  const Json json = Json::parse(readWholeFile(path, kMostBytes), nullptr, false);
  if (!json.is_object())
    throw badValue("{}: is no summary of a run", path);
  if (const Json *frames = json.contains("frames") ? &json["frames"] : nullptr;
      frames && frames->is_object() && frames->contains("all") && (*frames)["all"] == 0)
    throw badValue("{}: the run ended before its first frame; `bole track --resume` makes it", path);
  return json;
}

std::string faultOf(const std::string &path, const std::exception &error)
{
  const std::string text = error.what(); // "[json.exception.type_error.302] type must be ..."
  return fmt::format("{}: is damaged: {}", path,
                     text.substr(text.find("] ") == std::string::npos ? 0 : text.find("] ") + 2));
}

namespace
{
/// What \p read makes of a summary. \throw vpException naming the file where it does not hold that.
template <typename Read> auto partOf(const std::string &path, const Read &read)
{
  const Json json = readSummary(path);
  try {
    return read(json);
  }
  catch (const Json::exception &error) {
    throw badValue("{}", faultOf(path, error));
  }
}
} // namespace

WorldReference readReference(const std::string &path)
{
  return partOf(path, [&path](const Json &json) {
    WorldReference reference;
    reference.scale = sourceOf(path, json, "scale", ScaleSource::prior);
    reference.scale_sigma = numberOrZero(json, "scale_sigma");
    reference.gravity = sourceOf(path, json, "gravity", GravitySource::assumed);
    reference.gravity_sigma = numberOrZero(json, "gravity_sigma_rad");
    reference.has_ranges = json.value("ranges", true);
    return reference;
  });
}

PinholeCamera readCameraOfRun(const std::string &path)
{
  return partOf(path, [](const Json &json) -> PinholeCamera {
    const Json &camera = json.at("camera");
    return {camera.at("fx_px"), camera.at("fy_px"),    camera.at("cx_px"),
            camera.at("cy_px"), camera.at("width_px"), camera.at("height_px")};
  });
}

RunInput readInputOfRun(const std::string &path)
{
  const auto text = [](const Json &value) { return value.is_string() ? value.get<std::string>() : std::string(); };
  return partOf(path, [&text](const Json &json) -> RunInput {
    const Json &input = json.at("input");
    const std::filesystem::path folder = text(json.at("working_folder"));
    const std::string camera = text(input.at("camera_file"));
    return {(folder / text(input.at("source"))).string(), camera.empty() ? camera : (folder / camera).string()};
  });
}

void writeSummary(const std::string &path, const RunSummary &summary) { writeAtomically(path, toJson(summary)); }
} // namespace bole
