// SPDX-License-Identifier: GPL-2.0-or-later
// bole servo: flying by trunks, closed over rendered images and the tracker.
#include "data_files.h"
#include "lab_commands.h"
#include "overlay_window.h"
#include "support/text.h"

#include "progress.h"
#include "support/units.h"
#include "support/video.h"
#include "trials/closed_loop.h"
#include "trials/servo_trial.h"
#include <bole/config.h>
#include <bole/output_folder.h>
#include <bole/overlay.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <visp3/io/vpImageIo.h>

namespace bole::apps
{
namespace
{
struct ServoArguments
{
  ServoTrialOptions trial;
  std::string folder, fault = "none", perception = "real", config;
  std::vector<std::string> settings;
  int runs = 1;
  bool is_shown = false, has_video = true, is_quiet = false;
};

/// A figure of a run, for tables.
struct Column
{
  const char *name;
  double ServoTrialResult::*value;
};
const std::vector<Column> kColumns = {{"found after [s]", &ServoTrialResult::servoing_from_s},
                                      {"duration [s]", &ServoTrialResult::duration_s},
                                      {"bearing rms [deg]", &ServoTrialResult::bearing_rms_deg},
                                      {"distance rms [-]", &ServoTrialResult::distance_rms},
                                      {"distance mean [-]", &ServoTrialResult::distance_mean},
                                      {"r/d rms [-]", &ServoTrialResult::ratio_rms},
                                      {"turned [deg]", &ServoTrialResult::turned_deg},
                                      {"least clearance [m]", &ServoTrialResult::least_clearance},
                                      {"gap [m]", &ServoTrialResult::gap_width},
                                      {"progress [m]", &ServoTrialResult::progress},
                                      {"mean speed [m/s]", &ServoTrialResult::mean_speed},
                                      {"along the line [m/s]", &ServoTrialResult::speed_along},
                                      {"median loop [ms]", &ServoTrialResult::median_loop_ms},
                                      {"95 % loop [ms]", &ServoTrialResult::p95_loop_ms},
                                      {"hover after fault [s]", &ServoTrialResult::hover_after_s},
                                      {"drift in fault [m]", &ServoTrialResult::drift}};

/// A frame and what was found in it: the sheet of a failure shows one, and which is known at the end only.
struct SeenFrame
{
  vpImage<unsigned char> image;
  std::vector<TrunkInView> trunks;
};

vpImage<vpRGBa> pictureOf(const SeenFrame &frame, const LoopSample &sample, const PinholeCamera &camera)
{
  Overlay overlay;
  overlay.trunks = frame.trunks;
  overlay.is_warning = sample.is_lost;
  overlay.text = fmt::format("{:.1f} s  {}", sample.time_s, sample.reason);
  for (const auto &[name, value] : sample.real)
    if (name.rfind("r/d", 0) != 0) // the line is as long as the picture is wide
      overlay.text += fmt::format("  {} {:.1f}", name, value);
  return drawOverlay(frame.image, camera, overlay);
}

nlohmann::json toJson(const ServoTrialResult &result)
{
  nlohmann::json json{{"seed", result.seed},
                      {"success", result.is_success},
                      {"outcome", result.outcome},
                      {"other gap", result.is_other_gap},
                      {"sensors", nlohmann::json::array()}};
  for (const SensorVerdict &verdict : result.record.verdicts)
    json["sensors"].push_back(verdict.text);
  for (const Column &column : kColumns)
    json[column.name] = std::isnan(result.*column.value) ? nlohmann::json() : nlohmann::json(result.*column.value);
  return json;
}

std::string csvOf(const std::vector<ServoTrialResult> &results)
{
  std::string text = "seed,success,outcome";
  for (const Column &column : kColumns)
    text += fmt::format(",{}", column.name);
  for (const ServoTrialResult &result : results) {
    text += fmt::format("\n{},{:d},{}", result.seed, result.is_success, csvField(result.outcome));
    for (const Column &column : kColumns)
      text += std::isnan(result.*column.value) ? "," : fmt::format(",{:.4f}", result.*column.value);
  }
  return text + "\n";
}

std::map<std::string, int> failures(const std::vector<ServoTrialResult> &results)
{
  std::map<std::string, int> reasons;
  for (const ServoTrialResult &result : results)
    if (!result.is_success)
      ++reasons[result.outcome.substr(0, 10) == "stopped at" ? "stopped" : result.outcome];
  return reasons;
}

/// Of the runs that have the figure.
std::vector<double> valuesOf(const Column &column, const std::vector<ServoTrialResult> &results)
{
  std::vector<double> values;
  for (const ServoTrialResult &result : results)
    if (!std::isnan(result.*column.value))
      values.push_back(result.*column.value);
  return values;
}

template <class Is> int count(const std::vector<ServoTrialResult> &results, Is is)
{
  return static_cast<int>(std::count_if(results.begin(), results.end(), is));
}
int successes(const std::vector<ServoTrialResult> &results)
{
  return count(results, [](const ServoTrialResult &r) { return r.is_success; });
}
int contacts(const std::vector<ServoTrialResult> &results)
{
  return count(results, [](const ServoTrialResult &r) { return r.record.is_contact; });
}
int otherGaps(const std::vector<ServoTrialResult> &results)
{
  return count(results, [](const ServoTrialResult &r) { return r.is_success && r.is_other_gap; });
}

/// runs.csv and summary.json of the runs so far: written after each, so that what was flown is kept.
void writeTables(const ServoArguments &arguments, const std::vector<ServoTrialResult> &results)
{
  if (arguments.folder.empty())
    return;
  nlohmann::json json{{"complete", static_cast<int>(results.size()) == arguments.runs},
                      {"task", toString(arguments.trial.scenario.kind)},
                      {"runs", results.size()},
                      {"runs asked for", arguments.runs},
                      {"successes", successes(results)},
                      {"contacts", contacts(results)},
                      {"other gaps", otherGaps(results)},
                      {"failures", failures(results)},
                      {"gated", arguments.trial.pipeline.stages.saliency},
                      {"fault", arguments.fault},
                      {"perception", arguments.perception},
                      {"version", BOLE_VERSION}};
  for (const Column &column : kColumns)
    if (const std::vector<double> values = valuesOf(column, results); !values.empty())
      json["medians"][column.name] = {{"median", medianOf(values)}, {"of", values.size()}};
  for (const ServoTrialResult &result : results)
    json["each"].push_back(toJson(result));
  writeFile(arguments.folder + "/runs.csv", csvOf(results));
  writeFile(arguments.folder + "/summary.json", json.dump(1) + "\n");
}

/// Success, contacts, and medians with their quartiles; apps/campaign tells how far a share or a median can be trusted.
void print(const ServoArguments &arguments, const std::vector<ServoTrialResult> &results)
{
  fmt::print("{}: {} of {} run{} succeeded, {} touched a trunk\n", toString(arguments.trial.scenario.kind),
             successes(results), results.size(), results.size() == 1 ? "" : "s", contacts(results));
  if (otherGaps(results) > 0)
    fmt::print("  {:3} of them through another gap than the one set up\n", otherGaps(results));
  for (const ServoTrialResult &result : results)
    for (const SensorVerdict &verdict : result.record.verdicts)
      fmt::print("  seed {}: {}\n", result.seed, verdict.text);
  for (const auto &[reason, number] : failures(results))
    fmt::print("  {:3} {}\n", number, reason);
  for (const Column &column : kColumns)
    if (const std::vector<double> values = valuesOf(column, results); !values.empty())
      fmt::print("  {:22} median {}   [{}, {}]   of {}\n", column.name, figure(medianOf(values), 8, 3),
                 figure(quantileOf(values, 0.25), 0, 3), figure(quantileOf(values, 0.75), 0, 3), values.size());
  if (!arguments.folder.empty())
    fmt::print("{}/runs.csv, summary.json and a folder a run\n", arguments.folder);
}

std::string runFolder(const ServoArguments &arguments, std::uint64_t seed)
{
  if (arguments.folder.empty())
    return {};
  const std::string folder = fmt::format("{}/seed-{}", arguments.folder, seed);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw ioError("{}: cannot be made: {}", folder, error.message());
  return folder;
}

/// failure.json, and parting.png where there are images.
void writeFailure(const std::string &folder, const std::string &title, const ServoTrialResult &result,
                  const std::vector<SeenFrame> &frames, const PinholeCamera &camera)
{
  const auto parting = findParting(result.record, result.trunks);
  if (parting && parting->sample < frames.size())
    vpImageIo::write(pictureOf(frames[parting->sample], result.record.samples[parting->sample], camera),
                     folder + "/parting.png");
  writeFile(folder + "/failure.json", failureJson(result.record, result.trunks, title, parting));
  std::fprintf(stderr, "%s/failure.json: %s\n", folder.c_str(),
               parting ? parting->what.c_str() : "belief and truth did not part");
}

ServoTrialResult fly(const ServoArguments &arguments, ServoTrialOptions trial, std::uint64_t seed,
                     OverlayWindow &window)
{
  trial.scenario.seed = seed;
  const std::string folder = runFolder(arguments, seed);
  std::unique_ptr<Video> video;
  const bool has_video = arguments.has_video && !folder.empty();
  trial.robot.has_images = trial.perception != PerceptionKind::truth || has_video || arguments.is_shown;
  if (has_video)
    video = std::make_unique<Video>(folder + "/overlay.mp4", trial.robot.rate_hz);
  const PinholeCamera camera = trial.robot.renderer.camera.pinhole;
  std::vector<SeenFrame> frames;
  const auto watcher = [&](const Frame &frame, const FrameReport &report, const LoopSample &sample) {
    if (trial.robot.has_images && !folder.empty())
      frames.push_back({frame.image, report.trunks});
    if (video || arguments.is_shown) {
      const vpImage<vpRGBa> picture = pictureOf({frame.image, report.trunks}, sample, camera);
      if (video)
        video->write(picture);
      window.show(picture);
    }
    return !interrupted();
  };
  const ServoTrialResult result = runServoTrial(trial, watcher);
  if (video)
    video->finish();
  if (!folder.empty()) {
    const std::string title = fmt::format("{}, seed {}: {}", toString(trial.scenario.kind), seed,
                                          result.is_success ? "succeeded" : result.outcome);
    writeFile(folder + "/samples.csv", samplesCsv(result.record));
    if (!result.is_success)
      writeFailure(folder, title, result, frames, camera);
  }
  return result;
}

void run(ServoArguments &arguments)
{
  if (!arguments.config.empty())
    readConfig(findPreset(arguments.config), arguments.trial.pipeline);
  setOptions(arguments.settings, arguments.trial.pipeline);
  arguments.trial.loop.fault.kind = valueNamed<FaultKind>("fault", arguments.fault);
  arguments.trial.perception = valueNamed<PerceptionKind>("perception", arguments.perception);
  if (arguments.trial.perception == PerceptionKind::truth && arguments.fault != "none")
    throw badValue("fault = {} with perception = truth, must be none: no image is looked at", arguments.fault);
  arguments.trial.loop.validate();
  std::optional<OutputFolder> folder;
  if (!arguments.folder.empty())
    folder.emplace(arguments.folder, FileNames{"summary.json", "runs.csv"});
  OverlayWindow window(arguments.is_shown, "bole servo");
  endAtInterrupt();
  std::vector<ServoTrialResult> results;
  Progress progress(static_cast<std::size_t>(arguments.runs), stderr, "run");
  const std::uint64_t first = arguments.trial.scenario.seed;
  for (int k = 0; k < arguments.runs && !interrupted(); ++k) {
    ServoTrialResult result = fly(arguments, arguments.trial, first + static_cast<std::uint64_t>(k), window);
    if (interrupted())
      break; // half a run is neither a success nor a failure
    if (!arguments.is_quiet)
      progress.update(results.size() + 1,
                      fmt::format("seed {}: {}", result.seed, result.is_success ? "succeeded" : result.outcome));
    result.record.samples.clear(); // written already; a hundred of them would fill the memory
    result.trunks.clear();
    results.push_back(std::move(result));
    writeTables(arguments, results);
  }
  progress.finish();
  if (!results.empty() && !arguments.is_quiet)
    print(arguments, results);
  if (interrupted()) {
    std::fprintf(stderr, "bole: interrupted after %zu of %d runs\n", results.size(), arguments.runs);
    endWith(ExitCode::interrupted);
  }
}

void addTask(CLI::App &servo, ServoKind kind, const char *what, const char *example)
{
  const auto arguments = std::make_shared<ServoArguments>();
  ServoTrialOptions &trial = arguments->trial;
  trial.scenario.kind = kind;
  CLI::App *task = servo.add_subcommand(toString(kind), what);
  task->add_option("-o,--output", arguments->folder, "Folder for videos and tables");
  task->add_option("--seed", trial.scenario.seed, "Of the first run")->capture_default_str();
  task->add_option("--runs", arguments->runs, "Random starts, a seed each")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000));
  task->add_option("--density", trial.scenario.density,
                   "Trunks a square metre (hold, circle .03, gap .04, slalom .05)");
  if (kind == ServoKind::hold)
    task->add_option("--distance", trial.distance, "To be kept [m]: as good as the map's radius")
        ->capture_default_str()
        ->check(CLI::Range(0.5, 20.0));
  if (kind == ServoKind::hold || kind == ServoKind::circle)
    task->add_option("--ratio", trial.ratio,
                     "Radius over distance to be kept (circle .07; hold: instead of --distance)")
        ->check(CLI::Range(0.01, 0.5));
  if (kind != ServoKind::hold)
    task->add_option("--speed", trial.speed, "[m/s] (circle .5, gap .6, slalom 1.2)")->check(CLI::Range(0.05, 2.0));
  if (kind == ServoKind::circle)
    trial.loop.duration_s = 70; // round a trunk of 0.25 m at r/d .07
  if (kind == ServoKind::slalom) {
    trial.loop.duration_s = 90;
    task->add_option("--length", trial.scenario.length, "[m]")->capture_default_str()->check(CLI::Range(1.0, 1000.0));
  }
  task->add_option("--duration", trial.loop.duration_s, "Of servoing, at most [s]")->capture_default_str();
  task->add_option("--fault", arguments->fault,
                   "For a while: black, freeze, noise, smear (images), odometry-freeze, odometry-jump, odometry-gone, "
                   "gyro-gone, gyro-bias");
  task->add_option("--fault-at", trial.loop.fault.start_s, "After servoing began [s]")->capture_default_str();
  task->add_option("--fault-for", trial.loop.fault.duration_s, "[s]")->capture_default_str();
  task->add_option(
          "--perception", arguments->perception,
          "What the task is told: real (the tracker), truth-map (images tracked against the true trunks), visp-edges "
          "(the same by ViSP's edge tracker) or truth (no image is looked at)")
      ->capture_default_str();
  task->add_option(
          "--missing", trial.missing,
          "By truth: share of the trunks, those asked for not counted, that the map never has; no bark has points then")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  task->add_option("--rate", trial.robot.rate_hz, "Frames a second")->capture_default_str();
  task->add_option("--samples", trial.robot.renderer.samples_per_pixel, "Rays a pixel")->capture_default_str();
  task->add_option("--latency", trial.robot.video_delay_s,
                   "From exposure to the frame's arrival [s], known to the task")
      ->capture_default_str();
  task->add_option("--gust", trial.robot.body.gust, "Standard deviation of the wind's push [m/s^2]")
      ->capture_default_str();
  task->add_option("--config", arguments->config, "Options of the pipeline (YAML)");
  task->add_option("--set", arguments->settings, "One option of the pipeline, e.g. --set detection.window=30");
  task->add_flag("-q,--quiet", arguments->is_quiet, "Nothing but errors");
  task->add_flag("--show", arguments->is_shown, "Show the overlay in a window (X11)");
  task->add_flag("!--no-video", arguments->has_video, "Write no overlay.mp4");
  task->footer(fmt::format("Example: {}", example));
  task->callback([arguments] { run(*arguments); });
}
} // namespace

void addServo(CLI::App &app)
{
  CLI::App *servo = app.add_subcommand("servo", "Fly by trunks in a simulated forest, through the tracker");
  servo->require_subcommand(1);
  addTask(*servo, ServoKind::hold, "Keep the bearing and the distance of a trunk",
          "bole servo hold --seed 1 --runs 20 -o run/hold");
  addTask(*servo, ServoKind::circle, "Go round a trunk at constant r/d",
          "bole servo circle --ratio .08 --speed .5 -o run/circle --show");
  addTask(*servo, ServoKind::gap, "Pass between two trunks", "bole servo gap --runs 50 --no-video -o run/gap");
  addTask(*servo, ServoKind::slalom, "Through a stand of trees along a line",
          "bole servo slalom --length 40 --density .05 --runs 10 --set stages.saliency=false -o run/slalom");
  servo->footer(
      "The loop is closed over rendered images and the tracker; the truth only judges. The drone hovers where a frame\n"
      "cannot be believed or the trunk it flies by is lost: try --fault black.\n"
      "Example: bole servo hold --fault freeze --fault-at 8 --fault-for 3 -o run");
}
} // namespace bole::apps
