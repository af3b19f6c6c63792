// SPDX-License-Identifier: GPL-2.0-or-later
// `bole localise`: where on the map of an earlier flight this one is, without a first pose.
#include "commands.h"
#include "data_files.h"
#include "interrupt.h"

#include "geometry/cylinder.h"
#include "map/constellation.h"
#include "mbt/cao_reader.h"
#include "output/atomic_file.h"
#include "output/progress.h"
#include "output/trajectory_writer.h"
#include "output/trunks_csv.h"
#include <bole/open_source.h>
#include <bole/pipeline.h>

#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <visp3/core/vpException.h>

namespace bole::apps
{
namespace
{
constexpr double kMemory_s = 20;        ///< trunks seen within are asked: what is older has drifted against them
constexpr std::size_t kFramesApart = 5; ///< between two questions

struct LocaliseArguments
{
  std::string input, map, folder;
  SourceOptions source;
  double camera_height = 0;
  bool is_quiet = false;
};

std::vector<TrunkRecord> readMapOf(const std::string &path)
{
  std::vector<TrunkRecord> map;
  if (std::filesystem::is_directory(path)) {
    for (const TrunkRecord &trunk : readTrunks(path + "/trunks.csv")) {
      if (trunk.status == TrunkStatus::confirmed)
        map.push_back(trunk);
    }
  }
  else {
    for (const Cylinder &cylinder : readCao(path)) {
      TrunkRecord trunk;
      trunk.id = static_cast<int>(map.size());
      trunk.xy = (0.5 * (cylinder.foot + cylinder.top)).head<2>();
      trunk.radius = cylinder.radius;
      trunk.covariance.setZero();
      map.push_back(trunk);
    }
  }
  if (map.size() < 3)
    throw vpException(vpException::badValue, "%s: %d trunks, must be at least 3", path.c_str(),
                      static_cast<int>(map.size()));
  return map;
}

/// What this flight knows of the trunks about it.
std::vector<TrunkRecord> recentTrunks(const Pipeline &pipeline, double first_s, double now_s)
{
  std::vector<TrunkRecord> recent;
  for (const TrunkRecord &trunk : pipeline.map()) {
    if (trunk.status == TrunkStatus::confirmed && now_s - first_s - trunk.last_seen_s < kMemory_s)
      recent.push_back(trunk);
  }
  return recent;
}

Pose onMap(const Placement &placement, const Pose &wMb)
{
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(placement.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return Pose(turn * wMb.R, turn * wMb.t + Eigen::Vector3d(placement.t.x(), placement.t.y(), 0));
}

void localise(const LocaliseArguments &arguments)
{
  const std::vector<TrunkRecord> map = readMapOf(arguments.map);
  const std::unique_ptr<FrameSource> source = openSource(arguments.input, arguments.source);
  Options options;
  options.camera.compressed = source->isCompressed();
  options.camera.height = arguments.camera_height;
  Pipeline pipeline(source->camera(), source->bMc(), options);
  std::optional<Placement> placement;
  std::optional<double> first_s, placed_s;
  std::size_t frames = 0, placed_frames = 0;
  double now_s = 0;
  endAtInterrupt();
  Progress progress(source->size(), stderr);
  for (Frame frame; !interrupted() && source->next(frame);) {
    pipeline.process(frame);
    now_s = 1e-9 * static_cast<double>(frame.stamp_ns);
    first_s = first_s.value_or(now_s);
    if (++frames % kFramesApart == 0) {
      if (const auto found = placeOnMap(recentTrunks(pipeline, *first_s, now_s), map))
        placement = found;
      if (placement && !placed_s)
        placed_s = now_s - *first_s;
    }
    placed_frames += placement ? 1 : 0;
    if (!arguments.is_quiet)
      progress.update(frames, placement ? fmt::format("{} trunks agree", placement->matches.size()) : "not placed yet");
  }
  progress.finish();
  pipeline.finish();
  if (first_s) {
    if (const auto found = placeOnMap(recentTrunks(pipeline, *first_s, now_s), map))
      placement = found;
  }
  nlohmann::ordered_json json{{"frames", frames}, {"localised", placed_frames}};
  json["first_pose_s"] = placed_s ? nlohmann::ordered_json(*placed_s) : nullptr;
  std::filesystem::create_directories(arguments.folder);
  if (placement) {
    const Eigen::Vector3d sigma = placement->covariance.diagonal().cwiseSqrt();
    json["yaw_deg"] = placement->yaw * 180 / M_PI;
    json["x_m"] = placement->t.x();
    json["y_m"] = placement->t.y();
    json["yaw_sigma_deg"] = sigma[0] * 180 / M_PI;
    json["xy_sigma_m"] = sigma.tail<2>().norm();
    json["probability"] = placement->probability;
    json["trunks"] = nlohmann::ordered_json::array();
    for (const auto &[seen, known] : placement->matches)
      json["trunks"].push_back({{"seen", seen}, {"map", known}});
    Trajectory trajectory = pipeline.smoothedTrajectory();
    for (StampedPose &pose : trajectory)
      pose.wMb = onMap(*placement, pose.wMb);
    writeTrajectory(arguments.folder + "/trajectory.tum", trajectory);
  }
  writeAtomically(arguments.folder + "/localise.json", json.dump(1) + "\n");
  if (!placement) {
    fmt::print("{}: not placed on {}: another wood, too few trunks, or a map that looks the same in several places\n",
               arguments.folder, arguments.map);
    endWith(ExitCode::doubtful);
  }
  if (!arguments.is_quiet)
    fmt::print("{}: placed after {:.1f} s, {} of {} frames; {} trunks agree, sigma {:.2f} m and {:.1f} degrees\n",
               arguments.folder, placed_s.value_or(now_s - *first_s), placed_frames, frames, placement->matches.size(),
               json["xy_sigma_m"].get<double>(), json["yaw_sigma_deg"].get<double>());
  if (interrupted())
    endWith(ExitCode::interrupted);
}
} // namespace

void addLocalise(CLI::App &app)
{
  const auto arguments = std::make_shared<LocaliseArguments>();
  CLI::App *command =
      app.add_subcommand("localise", "Place a flight on the map of an earlier one, without a first pose");
  command->add_option("INPUT", arguments->input, "The new flight: EuRoC/ASL folder, video or numbered images")
      ->transform(findSequence)
      ->required();
  command->add_option("--map", arguments->map, "Folder of a run, or a .cao model of trunks")
      ->check(CLI::ExistingPath)
      ->required();
  command->add_option("-o,--output", arguments->folder, "Folder for the results")->required();
  command->add_option("--camera", arguments->source.camera_path, "Camera file, as for `bole track`");
  command
      ->add_option("--camera-height", arguments->camera_height,
                   "Height of the camera over the ground [m], which gives a video without odometry its scale")
      ->check(within(0.1, 100));
  command->add_flag("-q,--quiet", arguments->is_quiet, "Nothing but errors");
  command->footer(
      "The trunks that the flight maps itself are matched with those of the map by their places and radii; a "
      "constellation\n"
      "that fits twice, or that chance would fit, is not taken. Writes trajectory.tum in the frame of the map, and\n"
      "localise.json. Exit status 3: not placed.\n"
      "Example:\n"
      "  bole localise monday --map run/sunday -o run/monday-on-sunday");
  command->callback([arguments] { localise(*arguments); });
}
} // namespace bole::apps
