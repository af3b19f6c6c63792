// SPDX-License-Identifier: GPL-2.0-or-later
// `bole localise`: where on the map of an earlier flight this one is, without a first pose.
#include "localise.h"
#include "commands.h"
#include "data_files.h"
#include "input_checks.h"

#include "geometry/failure.h"
#include "input/atomic_file.h"
#include "input/trajectory.h"
#include "mbt/model_files.h"
#include "output/trunks_csv.h"
#include "progress.h"
#include <bole/cylinder.h>
#include <bole/open_source.h>
#include <bole/output_folder.h>

#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace bole::apps
{
namespace
{
constexpr double kMemory_s = 20;        ///< trunks seen within are asked: what is older has drifted against them
constexpr std::size_t kFramesApart = 5; ///< between two questions

Options optionsFor(const FrameSource &source, double camera_height)
{
  Options options;
  options.camera.compressed = source.isCompressed();
  options.camera.height = camera_height;
  options.stages.final_pass = false; // the map is asked in flight, and a live stream need not end
  return options;
}
} // namespace

std::vector<TrunkRecord> readKnownMap(const std::string &path)
{
  std::vector<TrunkRecord> map;
  if (std::filesystem::is_directory(path)) {
    for (const TrunkRecord &trunk : readTrunks(path + "/trunks.csv"))
      if (trunk.status == TrunkStatus::confirmed)
        map.push_back(trunk);
  }
  else {
    for (const Cylinder &cylinder : readTrunkModel(path)) {
      TrunkRecord trunk;
      trunk.id = static_cast<int>(map.size());
      trunk.xy = (0.5 * (cylinder.foot + cylinder.top)).head<2>();
      trunk.radius = cylinder.radius;
      trunk.covariance.setZero();
      map.push_back(trunk);
    }
  }
  if (map.size() < 3)
    throw badValue("{}: {} trunks, must be at least 3", path, map.size());
  return map;
}

Localiser::Localiser(std::vector<TrunkRecord> map, const FrameSource &source, double camera_height)
    : m_map(std::move(map)), m_pipeline(source.camera(), source.bMc(), optionsFor(source, camera_height))
{
}

void Localiser::ask()
{
  std::vector<TrunkRecord> recent;
  for (const TrunkRecord &trunk : m_pipeline.map())
    if (trunk.status == TrunkStatus::confirmed && m_now_s - *m_first_s - trunk.last_seen_s < kMemory_s)
      recent.push_back(trunk);
  if (const auto found = placeOnMap(recent, m_map))
    m_placement = found;
}

FrameReport Localiser::process(const Frame &frame)
{
  FrameReport report = m_pipeline.process(frame);
  m_now_s = 1e-9 * static_cast<double>(frame.stamp_ns);
  m_first_s = m_first_s.value_or(m_now_s);
  if (++m_frames % kFramesApart == 0) {
    ask();
    if (m_placement && !m_placed_s)
      m_placed_s = m_now_s - *m_first_s;
  }
  return report;
}

void Localiser::finish()
{
  m_pipeline.finish();
  if (m_first_s)
    ask();
  if (m_placement && !m_placed_s)
    m_placed_s = m_now_s - *m_first_s;
}

Pose Localiser::onMap(const Pose &wMb) const
{
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(m_placement->yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return Pose(turn * wMb.R, turn * wMb.t + Eigen::Vector3d(m_placement->t.x(), m_placement->t.y(), 0));
}

Trajectory Localiser::smoothedOnMap() const
{
  Trajectory trajectory = m_pipeline.smoothedTrajectory();
  for (StampedPose &pose : trajectory)
    pose.wMb = onMap(pose.wMb);
  return trajectory;
}

namespace
{
struct LocaliseArguments
{
  std::string input, map, folder;
  SourceOptions source;
  double camera_height = 0;
  bool is_quiet = false;
};

void localise(const LocaliseArguments &arguments)
{
  std::vector<TrunkRecord> map = readKnownMap(arguments.map);
  const std::unique_ptr<FrameSource> source = openSource(arguments.input, arguments.source);
  requireHeightUsed(arguments.camera_height, *source);
  const OutputFolder folder(arguments.folder, {"localise.json", "trajectory.tum"});
  Localiser localiser(std::move(map), *source, arguments.camera_height);
  std::size_t frames = 0, placed_frames = 0;
  endAtInterrupt();
  Progress progress(arguments.is_quiet ? 0 : source->size(), stderr);
  for (Frame frame; !interrupted() && source->next(frame);) {
    localiser.process(frame);
    const std::optional<Placement> &placement = localiser.placement();
    ++frames;
    placed_frames += placement ? 1 : 0;
    if (!arguments.is_quiet)
      progress.update(frames, placement ? fmt::format("{} trunks agree", placement->matches.size()) : "not placed yet");
  }
  progress.finish();
  localiser.finish();
  const std::optional<Placement> &placement = localiser.placement();
  const std::optional<double> placed_s = localiser.placedAfter_s();
  nlohmann::ordered_json json{{"complete", !interrupted()}, {"frames", frames}, {"localised", placed_frames}};
  json["first_pose_s"] = placed_s ? nlohmann::ordered_json(*placed_s) : nullptr;
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
    writeTrajectory(folder.file("trajectory.tum"), localiser.smoothedOnMap());
  }
  writeAtomically(folder.file("localise.json"), json.dump(1) + "\n");
  if (!placement) {
    fmt::print("{}: not placed on {}: another wood, too few trunks, or a map that looks the same in several places\n",
               arguments.folder, arguments.map);
    endWith(ExitCode::doubtful);
  }
  if (!arguments.is_quiet)
    fmt::print("{}: placed after {:.1f} s, {} of {} frames; {} trunks agree, sigma {:.2f} m and {:.1f} degrees\n",
               arguments.folder, *placed_s, placed_frames, frames, placement->matches.size(),
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
                   "Mean height of the camera over the ground [m], which gives a video without odometry its scale")
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
