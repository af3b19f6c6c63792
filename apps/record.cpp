// SPDX-License-Identifier: GPL-2.0-or-later
// `bole record`: a live flight, as raw bytes and as an ASL folder.
#include "commands.h"

#include "ardrone/flight_folder.h"
#include "progress.h"
#include <bole/ardrone_source.h>

#include <fmt/format.h>
#include <map>
#include <memory>
#include <visp3/core/vpException.h>

namespace bole::apps
{
namespace
{
struct RecordArguments
{
  std::string address, folder;
  ArDroneSource::Options source;
  double seconds = 0;
  bool raw_only = false, quiet = false;
};

using StatusCounts = std::map<FrameStatus, std::size_t>;

std::string textOf(const StatusCounts &counts, const LinkCounters &link, std::size_t bytes)
{
  std::string frames;
  for (const auto &[status, count] : counts)
    frames += fmt::format("{}{} {}", frames.empty() ? "" : ", ", count, toString(status));
  return fmt::format("{}; {} dropped; {} navdata, {} refused, {} late; {} connections; {:.1f} MB", frames, link.dropped,
                     link.navdata_packets, link.navdata_refused, link.navdata_late, link.connections,
                     static_cast<double>(bytes) * 1e-6);
}

void run(const RecordArguments &arguments)
{
  RecordingWriter raw(arguments.folder);
  ArDroneSource source(arguments.address, arguments.source,
                       [&raw](LinkChannel channel, std::int64_t arrival_ns, const std::uint8_t *data,
                              std::size_t size) { raw.write(channel, arrival_ns, data, size); });
  std::unique_ptr<FlightFolder> folder;
  if (!arguments.raw_only)
    folder = std::make_unique<FlightFolder>(arguments.folder, source.mountedCamera());
  endAtInterrupt();
  std::int64_t first_ns = -1;
  StatusCounts counts;
  Progress progress(0, stderr);
  for (Frame frame; !interrupted() && source.next(frame);) {
    if (first_ns < 0)
      first_ns = frame.stamp_ns;
    ++counts[frame.status];
    if (folder && frame.status != FrameStatus::missing)
      folder->write(source.liveFrame());
    if (!arguments.quiet)
      progress.update(frame.index + 1, textOf(counts, source.counters(), raw.bytes()));
    if (!raw.error().empty())
      throw vpException(vpException::ioError, raw.error());
    if (arguments.seconds > 0 && static_cast<double>(frame.stamp_ns - first_ns) * 1e-9 >= arguments.seconds)
      break;
  }
  progress.finish();
  if (!arguments.quiet)
    fmt::print(stderr, "{} in {}\n", textOf(counts, source.counters(), raw.bytes()), arguments.folder);
  if (interrupted()) // what was received is complete: Ctrl-C is how a recording without --seconds ends
    fmt::print(stderr, "bole: interrupted\n");
}
} // namespace

void addRecord(CLI::App &app)
{
  auto arguments = std::make_shared<RecordArguments>();
  CLI::App *command = app.add_subcommand("record", "Record an AR.Drone's flight: raw bytes, and an ASL folder");
  command
      ->add_option("address", arguments->address,
                   "ardrone://HOST[?offset=N&generation=1|2|auto&camera=FILE&video_delay_ms=N]")
      ->required();
  command->add_option("-o,--output", arguments->folder, "Folder to write")->required();
  command->add_option("--seconds", arguments->seconds,
                      "Stop after this time of flight (default: at Ctrl-C, or when the drone falls silent)");
  command->add_option("--give-up", arguments->source.give_up_s, "Silence that ends the recording [s] (default 10)");
  command->add_flag("--raw-only", arguments->raw_only, "No ASL folder");
  command->add_flag("-q,--quiet", arguments->quiet, "No progress");
  command->footer("Examples:\n"
                  "  bole record ardrone://192.168.1.1 -o flight\n"
                  "  bole record 'ardrone://127.0.0.1?offset=10000&camera=my.yaml' -o flight --seconds 60\n"
                  "Then: bole track flight --set camera.compressed=true, or bole replay flight");
  command->callback([arguments] { run(*arguments); });
}
} // namespace bole::apps
