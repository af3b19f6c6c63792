// SPDX-License-Identifier: GPL-2.0-or-later
// `bole simulate`: a flight through a rendered forest, with its truth.
#include "lab_commands.h"

#include "progress.h"
#include "simulation/simulated_flight.h"
#include <bole/ardrone_source.h>

#include <fmt/format.h>
#include <memory>

namespace bole::apps
{
namespace
{
struct SimulateArguments
{
  std::string scene_file, lens = "none";
  std::uint64_t seed = 1;
  SceneOptions scene;
  RecordOptions record;
  bool quiet = false;
};

/// Options of the command line go on top of the file's: only those that were given.
void run(const CLI::App &command, const SimulateArguments &arguments)
{
  SceneOptions scene = arguments.scene_file.empty() ? SceneOptions() : readScene(arguments.scene_file);
  if (arguments.scene_file.empty() && command.count("--samples") == 0)
    scene.renderer.samples_per_pixel = 8;
  const SceneOptions &given = arguments.scene;
  const auto take = [&command](const char *name, auto &field, const auto &value) {
    if (command.count(name) > 0)
      field = value;
  };
  if (command.count("--seed") > 0)
    scene.setSeed(arguments.seed);
  take("--density", scene.forest.density, given.forest.density);
  take("--light", scene.forest.light, given.forest.light);
  take("--bark", scene.forest.bark, given.forest.bark);
  take("--path", scene.flight.kind, given.flight.kind);
  take("--speed", scene.flight.speed, given.flight.speed);
  take("--flight-height", scene.flight.height, given.flight.height);
  take("--rate", scene.rate_hz, given.rate_hz);
  take("--exposure", scene.exposure_ms, given.exposure_ms);
  take("--h264", scene.h264_kbps, given.h264_kbps);
  take("--samples", scene.renderer.samples_per_pixel, given.renderer.samples_per_pixel);
  if (arguments.lens == "ardrone1")
    scene.renderer.camera = publishedArDroneCamera(1, 320, 240).model;
  else if (arguments.lens == "ardrone2")
    scene.renderer.camera = publishedArDroneCamera(2, 640, 360).model;
  Progress progress(static_cast<std::size_t>(arguments.record.frames), stderr);
  recordFlight(scene, arguments.record, [&](int done) {
    if (!arguments.quiet)
      progress.update(static_cast<std::size_t>(done));
  });
  progress.finish();
  fmt::print("{}\n", arguments.record.folder);
}
} // namespace

void addSimulate(CLI::App &app)
{
  auto arguments = std::make_shared<SimulateArguments>();
  CLI::App *command =
      app.add_subcommand("simulate", "Render a flight through a forest, with its truth, as an ASL folder");
  SceneOptions &scene = arguments->scene;
  command->add_option("-o,--output", arguments->record.folder, "Folder to write")->required();
  command->add_option("--scene", arguments->scene_file, "Scene file (YAML); the options below go on top of it");
  command->add_option("--seed", arguments->seed, "Same seed, same bytes (default 1)");
  command->add_option("--density", scene.forest.density, "Trunks a square metre (default 0.06)");
  command->add_option("--light", scene.forest.light, "sun or overcast (default)")
      ->transform(CLI::CheckedTransformer(wordsOf(Light())));
  command->add_option("--bark", scene.forest.bark, "dark (default), bright or mixed")
      ->transform(CLI::CheckedTransformer(wordsOf(Bark())));
  command->add_option("--path", scene.flight.kind, "forward (default), lateral, loop or slalom")
      ->transform(CLI::CheckedTransformer(wordsOf(PathKind())));
  command->add_option("--frames", arguments->record.frames, "Number of frames (default 120)");
  command->add_option("--speed", scene.flight.speed, "[m/s] (default 1)");
  command->add_option("--flight-height", scene.flight.height, "Over the ground at the start [m] (default 1.2)");
  command->add_option("--rate", scene.rate_hz, "Frames a second (default 10)");
  command->add_option("--exposure", scene.exposure_ms, "Time of exposure [ms]: motion blur (default 6)");
  command->add_option("--samples", scene.renderer.samples_per_pixel, "Rays a pixel (default 8)");
  command
      ->add_option("--camera", arguments->lens,
                   "none (f = 200 px, no distortion; or the scene's), ardrone1 or ardrone2")
      ->check(CLI::IsMember({"none", "ardrone1", "ardrone2"}));
  command->add_option("--h264", scene.h264_kbps, "Pass the pictures through H.264 at this bit rate [kbit/s]");
  command->add_flag("--truth-images", arguments->record.truth_images, "Write depth/ and trunk_id/ too");
  command->add_flag("--overwrite", arguments->record.overwrite, "Replace the folder");
  command->add_flag("-q,--quiet", arguments->quiet, "No progress");
  command->footer("Examples:\n"
                  "  bole simulate --seed 7 --density 0.08 --light sun --path slalom -o flight\n"
                  "  bole simulate --seed 7 --camera ardrone2 --h264 1000 --truth-images -o flight\n"
                  "  bole simulate --scene flight/scene.yaml --seed 8 -o another");
  command->callback([command, arguments] { run(*command, *arguments); });
}
} // namespace bole::apps
