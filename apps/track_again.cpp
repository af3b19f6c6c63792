// SPDX-License-Identifier: GPL-2.0-or-later
// bole track --again and --resume: a run is repeated or completed from what its folder holds.
#include "geometry/failure.h"
#include "track_arguments.h"
#include "track_output.h"

#include "input/regular_file.h"
#include "output/summary_json.h"

#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace bole::apps
{
namespace
{
namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string bytesOf(const fs::path &path)
{
  constexpr std::size_t kMostBytes = 1'000'000'000;
  return readWholeFile(path.string(), kMostBytes);
}

Json summaryOf(const fs::path &run)
{
  const fs::path path = run / "summary.json";
  Json json = Json::parse(bytesOf(path), nullptr, false);
  try {
    if (const auto words = json.at("command").get<std::vector<std::string>>(); words.size() < 2 || words[1] != "track")
      throw badValue("{}: command: must be one of `bole track`", path.string());
    json.at("input").at("source").get<std::string>();
    json.at("frames").at("all").get<std::size_t>();
    json.at("working_folder");
    json.value("complete", true);
    json.value("ended", true);
  }
  catch (const Json::exception &error) {
    throw badValue("{}", faultOf(path.string(), error));
  }
  return json;
}

/// The recorded command line with the options that were in effect, whatever the defaults and presets are now.
TrackArguments argumentsOf(const Json &summary, const fs::path &run)
{
  const std::vector<std::string> command = summary["command"];
  const auto arguments = std::make_shared<TrackArguments>();
  CLI::App app;
  CLI::App *track = app.add_subcommand("track");
  addTrackOptions(*track, arguments);
  try {
    app.parse(std::vector<std::string>(command.rbegin(), command.rend() - 1)); // CLI11 wants the last word first
    settle(*track, *arguments);
  }
  catch (const CLI::ParseError &error) {
    throw badValue("{}/summary.json: command: {}", run.string(), error.what());
  }
  if (ArDroneSource::accepts(arguments->input))
    throw badValue("{}: a live flight cannot be repeated; `bole record` keeps one", arguments->input);
  if (const fs::path options = run / "options.yaml"; fs::exists(options)) { // not in a run of no frame
    arguments->config = options.string();
    arguments->settings.clear();
    arguments->camera_height = 0; // among the options
  }
  arguments->is_shown = false;
  return *arguments;
}

/// Throws where something beside \p name, its folder and --quiet is given: it would be another run.
void requireAlone(const CLI::App &command, const std::string &name)
{
  for (const CLI::Option *option : command.get_options())
    if (option->count() > 0 && !option->check_lname(name) && !option->check_lname("output") &&
        !option->check_lname("quiet"))
      throw badValue("--{} repeats a run as it was made: {} does not go with it", name, option->get_name());
}

/// Paths of the command line are those of the folder in which the run was made.
void enterFolderOf(const Json &summary)
{
  const std::string folder = summary["working_folder"].is_string() ? summary["working_folder"].get<std::string>() : "";
  if (folder.empty())
    return;
  std::error_code error;
  fs::current_path(folder, error);
  if (error)
    throw ioError("{}: the run was made in this folder, which cannot be entered: {}", folder, error.message());
}

void sayChanges(const Json &before, const Json &now)
{
  for (const char *key : {"bole", "commit", "opencv", "visp", "libav"}) {
    const std::string was = before["versions"].value(key, "unknown"), is = now["versions"].value(key, "unknown");
    if (was != is)
      fmt::print("  {} was {}, is {}\n", key, was, is);
  }
  if (before["input"].value("sha256", Json()) != now["input"].value("sha256", Json()))
    fmt::print("  the input is not the same: its SHA-256 differs\n");
}
} // namespace

void trackAgain(const CLI::App &command, const TrackArguments &given)
{
  requireAlone(command, "again");
  const fs::path run = fs::absolute(given.again);
  readSummary((run / "summary.json").string()); // has a frame to repeat
  const Json summary = summaryOf(run);
  const fs::path repeated = given.run.empty() ? run / "again" : fs::absolute(given.run);
  enterFolderOf(summary);
  TrackArguments arguments = argumentsOf(summary, run);
  arguments.run = repeated.string();
  arguments.has_video = false;
  arguments.is_quiet = true;
  if (!summary.value("complete", true))
    arguments.frames_most = summary["frames"]["all"];
  arguments.is_cut = !summary.value("ended", true);
  g_command_line = summary["command"].get<std::vector<std::string>>();
  try {
    track(arguments);
  }
  catch (const CLI::RuntimeError &end) { // a run that is not to be trusted is repeated as such
    if (end.get_exit_code() != static_cast<int>(ExitCode::doubtful))
      throw;
  }
  bool is_same = true;
  for (const char *name : {"trunks.csv", "trajectory.tum"}) {
    const bool is_equal = bytesOf(run / name) == bytesOf(repeated / name);
    is_same = is_same && is_equal;
    if (!given.is_quiet)
      fmt::print("{}: {}\n", name, is_equal ? "the same bytes" : "DIFFERS");
  }
  if (!is_same) {
    if (!given.is_quiet)
      sayChanges(summary, summaryOf(repeated));
    fmt::print(stderr, "bole: {} does not come out as it was; the repetition is in {}\n", run.string(),
               repeated.string());
    endWith(ExitCode::doubtful);
  }
  if (given.run.empty())
    removeFiles(repeated.string(), kRunFiles);
}

void resume(const CLI::App &command, const TrackArguments &given)
{
  requireAlone(command, "resume");
  if (!given.run.empty())
    throw badValue("--resume completes a run in its own folder: --output does not go with it");
  const fs::path run = fs::absolute(given.resumed);
  const Json summary = summaryOf(run);
  if (summary.value("complete", true)) {
    if (!given.is_quiet)
      fmt::print("{}: is complete\n", given.resumed);
    return;
  }
  enterFolderOf(summary);
  TrackArguments arguments = argumentsOf(summary, run);
  arguments.run = run.string();
  arguments.is_quiet = arguments.is_quiet || given.is_quiet;
  g_command_line = summary["command"].get<std::vector<std::string>>();
  track(arguments);
}
} // namespace bole::apps
