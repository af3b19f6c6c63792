// SPDX-License-Identifier: GPL-2.0-or-later
// bole benchmark: simulate, track and evaluate over many forests; medians with intervals.
#include "commands.h"
#include "data_files.h"
#include "interrupt.h"

#include "lab/simulation/words.h"
#include "lab/trials/accuracy_trial.h"
#include "lab/trials/median_interval.h"
#include "output/atomic_file.h"
#include "output/figure.h"
#include "output/progress.h"
#include <bole/config.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

namespace bole::apps
{
namespace
{
struct BenchmarkArguments
{
  int seeds = 5, frames = 120, samples = 4;
  std::uint64_t first_seed = 101;
  std::vector<double> densities{0.04, 0.08};
  std::vector<Light> lights{Light::sun, Light::overcast};
  PathKind path = PathKind::forward;
  Bark bark = Bark::mixed;
  std::string folder, config, json;
  bool is_quiet = false;
  std::vector<std::string> settings;
  double h264_kbps = 0;
};

struct BenchmarkFlight
{
  std::uint64_t seed;
  double density;
  Light light;
  AccuracyTrialResult result;
};

/// A figure of a flight; NaN where there was nothing to measure.
struct Measure
{
  const char *name, *unit; ///< "%": a share of 0 to 1
  std::function<double(const AccuracyTrialResult &)> of;
};

const std::vector<Measure> &measures()
{
  constexpr auto kAligned = static_cast<std::size_t>(Alignment::xy_yaw);
  constexpr auto kScaled = static_cast<std::size_t>(Alignment::xy_yaw_scale);
  using Result = AccuracyTrialResult;
  static const std::vector<Measure> list = {
      {"recall", "%", [](const Result &r) { return r.trunks.recall; }},
      {"precision", "%", [](const Result &r) { return r.trunks.precision; }},
      {"duplicates", "%", [](const Result &r) { return r.trunks.duplicates; }},
      {"position median", "m", [=](const Result &r) { return r.trunks.all.median[kAligned]; }},
      {"position RMSE", "m", [=](const Result &r) { return r.trunks.all.rmse[kAligned]; }},
      {"... aligned in scale", "m", [=](const Result &r) { return r.trunks.all.rmse[kScaled]; }},
      {"radius RMSE", "m", [](const Result &r) { return r.trunks.all.radius_rmse; }},
      {"radius bias", "m", [](const Result &r) { return r.trunks.all.radius_bias; }},
      {"NEES/2", "", [](const Result &r) { return r.trunks.all.nees_half; }},
      {"ATE", "m", [](const Result &r) { return r.trajectory.ate; }},
      {"ATE, pose filter", "m", [](const Result &r) { return r.odometry.ate; }},
      {"ATE, scale", "m", [](const Result &r) { return r.trajectory_scaled.ate; }},
      {"ATE, scale, filter", "m", [](const Result &r) { return r.odometry_scaled.ate; }},
      {"median frame", "ms", [](const Result &r) { return r.median_ms; }}};
  return list;
}

std::string titleOf(const Measure &measure)
{
  return *measure.unit == '\0' ? measure.name : fmt::format("{} [{}]", measure.name, measure.unit);
}
double factorOf(const Measure &measure) { return *measure.unit == '%' ? 100 : 1; }

SceneOptions sceneOf(const BenchmarkArguments &arguments, std::uint64_t seed, double density, Light light)
{
  SceneOptions scene;
  scene.setSeed(seed);
  scene.forest.density = density;
  scene.forest.light = light;
  scene.forest.bark = arguments.bark;
  scene.flight.kind = arguments.path;
  scene.renderer.samples_per_pixel = arguments.samples;
  scene.h264_kbps = arguments.h264_kbps;
  scene.validate();
  return scene;
}

std::string csvOf(const std::vector<BenchmarkFlight> &flights)
{
  std::string text = "seed,density,light,expected,found,confirmed,matched";
  for (const Measure &measure : measures())
    text += fmt::format(",{}", titleOf(measure));
  for (const BenchmarkFlight &flight : flights) {
    const TrunkMetrics &trunks = flight.result.trunks;
    text += fmt::format("\n{},{},{},{},{},{},{}", flight.seed, flight.density, wordOf(flight.light),
                        trunks.all.expected, trunks.all.found, trunks.confirmed, trunks.matches.size());
    for (const Measure &measure : measures()) {
      const double value = factorOf(measure) * measure.of(flight.result);
      text += std::isnan(value) ? "," : fmt::format(",{:.5g}", value);
    }
  }
  return text + "\n";
}

/// Sums over the flights as well as medians: a flight with two trunks counts as two.
/// \p text is what people read of it.
nlohmann::json summarise(const std::string &name, const std::vector<const BenchmarkFlight *> &flights,
                         std::string &text)
{
  nlohmann::json json{{"name", name}, {"flights", flights.size()}};
  std::size_t expected = 0, found = 0, confirmed = 0, matched = 0;
  for (const BenchmarkFlight *flight : flights) {
    expected += flight->result.trunks.all.expected;
    found += flight->result.trunks.all.found;
    confirmed += flight->result.trunks.confirmed;
    matched += flight->result.trunks.matches.size();
  }
  const ShareInterval recall = wilson(static_cast<int>(found), static_cast<int>(expected));
  const ShareInterval precision = wilson(static_cast<int>(matched), static_cast<int>(confirmed));
  const auto told = [](const ShareInterval &interval, std::size_t part, std::size_t whole) {
    return fmt::format("{} [{}, {}] ({} of {})", percent(interval.share), percent(interval.low), percent(interval.high),
                       part, whole);
  };
  text +=
      fmt::format("\n{}: {} flight{}; of all trunks recall {}, precision {}\n", name, flights.size(),
                  flights.size() == 1 ? "" : "s", told(recall, found, expected), told(precision, matched, confirmed));
  json["recall"] = {
      {"share", recall.share}, {"low", recall.low}, {"high", recall.high}, {"found", found}, {"expected", expected}};
  json["precision"] = {{"share", precision.share},
                       {"low", precision.low},
                       {"high", precision.high},
                       {"matched", matched},
                       {"confirmed", confirmed}};
  for (const Measure &measure : measures()) {
    std::vector<double> values;
    for (const BenchmarkFlight *flight : flights)
      values.push_back(factorOf(measure) * measure.of(flight->result));
    const MedianInterval median = bootstrapMedian(values);
    text += fmt::format("  {:26} median {}   [{}, {}]   of {}\n", titleOf(measure), figure(median.median, 8, 3),
                        figure(median.low, 0, 3), figure(median.high, 0, 3), median.count);
    json["medians"][titleOf(measure)] = {
        {"median", median.median}, {"low", median.low}, {"high", median.high}, {"of", median.count}};
  }
  return json;
}

void report(const BenchmarkArguments &arguments, const std::vector<BenchmarkFlight> &flights)
{
  nlohmann::json json{{"version", BOLE_VERSION},        {"frames", arguments.frames},
                      {"samples", arguments.samples},   {"path", wordOf(arguments.path)},
                      {"bark", wordOf(arguments.bark)}, {"first_seed", arguments.first_seed}};
  std::string text;
  const auto group = [&](const std::string &name, const auto &belongs) {
    std::vector<const BenchmarkFlight *> members;
    for (const BenchmarkFlight &flight : flights)
      if (belongs(flight))
        members.push_back(&flight);
    if (!members.empty())
      json["groups"].push_back(summarise(name, members, text));
  };
  if (arguments.densities.size() > 1)
    for (const double density : arguments.densities)
      group(fmt::format("{} trunks a m^2", density),
            [density](const BenchmarkFlight &f) { return f.density == density; });
  if (arguments.lights.size() > 1)
    for (const Light light : arguments.lights)
      group(wordOf(light), [light](const BenchmarkFlight &f) { return f.light == light; });
  group("all", [](const BenchmarkFlight &) { return true; });
  if (!arguments.is_quiet)
    std::fputs(text.c_str(), stdout);
  if (!arguments.folder.empty())
    writeAtomically(arguments.folder + "/flights.csv", csvOf(flights));
  if (!arguments.folder.empty() || !arguments.json.empty())
    writeAtomically(arguments.json.empty() ? arguments.folder + "/benchmark.json" : arguments.json,
                    json.dump(1) + "\n");
}

void run(const BenchmarkArguments &arguments)
{
  Options options;
  if (!arguments.config.empty())
    readConfig(findPreset(arguments.config), options);
  setOptions(arguments.settings, options);
  for (const double density : arguments.densities) // before any work
    sceneOf(arguments, arguments.first_seed, density, Light::sun);
  if (!arguments.folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(arguments.folder, error);
    if (error)
      throw vpException(vpException::ioError, "%s: cannot be made: %s", arguments.folder.c_str(),
                        error.message().c_str());
  }
  endAtInterrupt();
  std::vector<BenchmarkFlight> flights;
  const std::size_t total =
      static_cast<std::size_t>(arguments.seeds) * arguments.densities.size() * arguments.lights.size();
  Progress progress(total, stderr, "flight");
  std::size_t confirmed = 0;
  for (int k = 0; k < arguments.seeds; ++k)
    for (const double density : arguments.densities)
      for (const Light light : arguments.lights) {
        const std::uint64_t seed = arguments.first_seed + static_cast<std::uint64_t>(k);
        BenchmarkFlight flight{seed, density, light, {}};
        flight.result =
            runAccuracyTrial(sceneOf(arguments, seed, density, light), arguments.frames, options, interrupted);
        if (interrupted()) { // the flights that were finished count
          progress.finish();
          fmt::print(stderr, "bole: interrupted after {} of {} flights\n", flights.size(), total);
          if (!flights.empty())
            report(arguments, flights);
          endWith(ExitCode::interrupted);
        }
        confirmed += flight.result.trunks.confirmed;
        flights.push_back(std::move(flight));
        if (!arguments.is_quiet)
          progress.update(flights.size(), fmt::format("{} trunks", confirmed));
      }
  progress.finish();
  report(arguments, flights);
}
} // namespace

void addBenchmark(CLI::App &app)
{
  const auto arguments = std::make_shared<BenchmarkArguments>();
  CLI::App *command =
      app.add_subcommand("benchmark", "Simulate, track and evaluate many flights; medians with 95 % intervals");
  command->add_option("-o,--output", arguments->folder, "Folder for flights.csv and benchmark.json");
  command->add_option("--seeds", arguments->seeds, "Forests for each density and light")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000));
  command->add_option("--first-seed", arguments->first_seed, "The others follow it")->capture_default_str();
  command->add_option("--density", arguments->densities, "Trunks a square metre, one or more (default 0.04 0.08)");
  command->add_option("--light", arguments->lights, "sun, overcast or both (default)")
      ->transform(CLI::CheckedTransformer(wordsOf(Light())));
  command->add_option("--bark", arguments->bark, "dark, bright or mixed (default)")
      ->transform(CLI::CheckedTransformer(wordsOf(Bark())));
  command->add_option("--path", arguments->path, "forward (default), lateral, loop or slalom")
      ->transform(CLI::CheckedTransformer(wordsOf(PathKind())));
  command->add_option("--frames", arguments->frames, "Of a flight")
      ->capture_default_str()
      ->check(CLI::Range(20, 100000));
  command->add_option("--samples", arguments->samples, "Rays a pixel")->capture_default_str()->check(CLI::Range(1, 64));
  command->add_option("--h264", arguments->h264_kbps, "Pass the pictures through H.264 at this bit rate [kbit/s]");
  command->add_option("--config", arguments->config, "Options of the pipeline (YAML)");
  command->add_option("--set", arguments->settings, "One option of the pipeline, e.g. --set detection.window=30");
  command->add_flag("-q,--quiet", arguments->is_quiet, "No table and no progress");
  command->add_option("--json", arguments->json, "File for all figures (default OUT/benchmark.json)");
  command->footer("95 % intervals: of medians by bootstrap over the flights, of shares by Wilson; none of one flight. "
                  "\"-\" and null:\n"
                  "there was nothing to measure. Ctrl-C reports the flights finished; the exit status is then 130.\n"
                  "Examples:\n"
                  "  bole benchmark --seeds 10 -o run/benchmark\n"
                  "  bole benchmark --seeds 5 --density .12 --light sun --path slalom --set flow.use_saliency=false");
  command->callback([arguments] { run(*arguments); });
}
} // namespace bole::apps
