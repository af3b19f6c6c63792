// SPDX-License-Identifier: GPL-2.0-or-later
// `bole emulate`: a sequence or video served as an AR.Drone serves its flight.
#include "lab_commands.h"

#include "emulator/emulator.h"
#include "progress.h"
#include <bole/open_source.h>

#include <fmt/format.h>
#include <memory>

namespace bole::apps
{
namespace
{
/// Of both commands: `replay` has no options of a source, a feed and faults.
struct EmulateArguments
{
  std::string input;
  SourceOptions source;
  SequenceFeedOptions feed;
  ArDroneEmulator::Options emulator;
  double jitter_ms = 0, bit_rate_kbps = 1300;
  int offset = 0;
  bool quiet = false;
};

void setPorts(ArDroneEmulator::Options &options, int offset)
{
  options.navdata_port = static_cast<std::uint16_t>(5554 + offset);
  options.video_port = static_cast<std::uint16_t>(5555 + offset);
  options.at_port = static_cast<std::uint16_t>(5556 + offset);
}

void serve(ArDroneEmulator &emulator, bool quiet)
{
  endAtInterrupt();
  emulator.start();
  Progress progress(0, stderr);
  while (!emulator.wait(0.25) && !interrupted())
    if (!quiet) {
      const auto counters = emulator.counters();
      progress.update(counters.frames, fmt::format("{:.1f} s, {} navdata", counters.flight_s, counters.navdata));
    }
  progress.finish();
  emulator.stop();
  const auto c = emulator.counters();
  if (!quiet)
    fmt::print(stderr,
               "{:.1f} s flown; sent {} frames, {} navdata; faults: {} lost, {} frames and {} "
               "navdata corrupted, {} frozen, {} stalled, {} reboots; {} frames not read\n",
               c.flight_s, c.frames, c.navdata, c.lost, c.corrupted_frames, c.corrupted_navdata, c.frozen, c.stalled,
               c.reboots, c.refused);
}

void run(EmulateArguments &arguments)
{
  arguments.emulator.jitter_s = arguments.jitter_ms / 1000;
  arguments.emulator.bit_rate = arguments.bit_rate_kbps * 1000;
  setPorts(arguments.emulator, arguments.offset);
  const auto source = openSource(arguments.input, arguments.source);
  const PinholeCamera camera = source->camera();
  const bool has_odometry = source->hasOdometry();
  ArDroneEmulator emulator(makeSequenceFeed(*source, arguments.feed), arguments.emulator);
  if (!arguments.quiet)
    fmt::print(stderr,
               "AR.Drone {} at ardrone://127.0.0.1{}; images {}x{}, f = {:.1f} px{}; waits for a "
               "listener\n",
               arguments.feed.generation, arguments.offset != 0 ? fmt::format("?offset={}", arguments.offset) : "",
               camera.width, camera.height, camera.fx, has_odometry ? "" : "; no odometry in it: navdata stand still");
  serve(emulator, arguments.quiet);
}

void replay(EmulateArguments &arguments)
{
  setPorts(arguments.emulator, arguments.offset);
  auto feed = makeRecordingFeed(arguments.input);
  if (!arguments.quiet)
    fmt::print(stderr, "AR.Drone {} of {} at ardrone://127.0.0.1{}; waits for a listener\n", feed->generation(),
               arguments.input, arguments.offset != 0 ? fmt::format("?offset={}", arguments.offset) : "");
  ArDroneEmulator emulator(std::move(feed), arguments.emulator);
  serve(emulator, arguments.quiet);
}
} // namespace

void addEmulate(CLI::App &app)
{
  auto arguments = std::make_shared<EmulateArguments>();
  ArDroneEmulator::Options &emulator = arguments->emulator;
  CLI::App *command = app.add_subcommand("emulate", "Serve a sequence or video as an AR.Drone would, on loopback");
  command->add_option("input", arguments->input, "ASL folder, numbered images or video")->required();
  command->add_option("--generation", arguments->feed.generation, "1 (UVLC over UDP) or 2 (H.264 over TCP, default)")
      ->check(CLI::IsMember({1, 2}));
  command->add_option("--speed", emulator.speed, "Flight seconds a second, 1 to 20 (default 1)");
  command->add_flag("--loop", arguments->feed.loop, "There and back for ever");
  command->add_option("--frames", arguments->feed.max_frames, "Only the first frames");
  command->add_option("--camera", arguments->source.camera_path, "Camera file of the input");
  command->add_option("--offset", arguments->offset, "Added to the ports 5554 to 5556 (default 0)")
      ->check(CLI::Range(0, 59000));
  command->add_option("--bit-rate", arguments->bit_rate_kbps,
                      "Of the H.264 [kbit/s] (default 1300, as captured; the drone's most is 4000)");
  command->add_option("--loss", emulator.loss, "Share of packets not sent, [0, 1)");
  command->add_option("--jitter", arguments->jitter_ms, "Largest extra delay of a packet [ms]");
  command->add_option("--corrupt", emulator.corrupt, "Share of packets with changed bytes, [0, 1)");
  command->add_option("--reboot", emulator.reboot_at_s, "Reboot at this time of the flight [s]");
  command->add_option("--freeze", emulator.freeze_at_s,
                      "From this time [s] the camera sends one picture for --freeze-for");
  command->add_option("--freeze-for", emulator.freeze_for_s, "[s] (default 2)");
  command->add_option("--stall", emulator.stall_at_s, "From this time [s] no video for --stall-for");
  command->add_option("--stall-for", emulator.stall_for_s, "[s] (default 2)");
  command->add_flag("--clock-wrap", emulator.clock_wrap, "Both clocks wrap after 3 s");
  command->add_option("--seed", emulator.seed, "Of the faults (default 1)");
  command->add_flag("-q,--quiet", arguments->quiet, "No progress");
  command->footer("Examples:\n"
                  "  bole emulate data/park-forward --offset 10000 &\n"
                  "  bole track "
                  "'ardrone://127.0.0.1?offset=10000&camera=data/park-forward/mav0/cam0/sensor.yaml'\n"
                  "  bole emulate flight --generation 1 --loop --speed 2 --loss 0.05 --reboot 20");
  command->callback([arguments] { run(*arguments); });
}

void addReplay(CLI::App &app)
{
  auto arguments = std::make_shared<EmulateArguments>();
  CLI::App *command = app.add_subcommand("replay", "Serve a recorded flight again as the drone did");
  command->add_option("flight", arguments->input, "Folder of `bole record`, or its raw.bin")->required();
  command->add_option("--speed", arguments->emulator.speed, "Flight seconds a second, 1 to 20 (default 1)");
  command->add_option("--offset", arguments->offset, "Added to the ports 5554 to 5556 (default 0)")
      ->check(CLI::Range(0, 59000));
  command->add_flag("-q,--quiet", arguments->quiet, "No progress");
  command->footer("Example:\n  bole replay flight --offset 10000");
  command->callback([arguments] { replay(*arguments); });
}
} // namespace bole::apps
