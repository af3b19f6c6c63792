// SPDX-License-Identifier: GPL-2.0-or-later
// bole track: from a flight through trees to a map of trunks and a trajectory.
#include "commands.h"
#include "data_files.h"
#include "field_of_view.h"
#include "interrupt.h"
#include "overlay_window.h"
#include "track_output.h"

#include "output/progress.h"
#include "pipeline/stage_options.h"
#include <bole/ardrone_source.h>
#include <bole/config.h>
#include <bole/open_source.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fmt/format.h>
#include <memory>

namespace bole::apps
{
namespace
{
struct TrackArguments
{
  std::string input, run, config;
  std::vector<std::string> settings;
  SourceOptions source;
  bool is_shown = false, has_video = true, is_quiet = false, is_without_odometry = false, is_without_gyro = false,
       is_online = false;
  std::size_t frames_most = 0;
  double give_up_s = ArDroneSource::Options().give_up_s;
  double camera_height = 0;
  bool is_field_of_view_given = false;
};

/// A video without a camera file is looked through for a pan that tells its field of view.
std::unique_ptr<FrameSource> openVideo(const TrackArguments &arguments, RunSummary &made)
{
  auto source = openSource(arguments.input, arguments.source);
  made.note = source->note();
  made.is_camera_known = source->isCameraKnown() || arguments.is_field_of_view_given;
  if (made.is_camera_known)
    return source;
  const FieldOfView view = fieldOfView(arguments.input, arguments.source);
  if (view.degrees == 0)
    return source;
  SourceOptions options = arguments.source;
  options.field_of_view_deg = std::clamp(view.degrees, 10.0, 150.0);
  source = openSource(arguments.input, options);
  made.is_camera_known = true;
  made.note = fmt::format(
      "no camera file: the camera rotates as one with a field of view of {:.1f} +- {:.1f} degrees (f = {:.0f} px)",
      view.degrees, view.sigma_degrees, source->camera().fx);
  return source;
}

std::unique_ptr<FrameSource> openInput(const TrackArguments &arguments, RunSummary &made)
{
  if (!ArDroneSource::accepts(arguments.input))
    return openVideo(arguments, made);
  ArDroneSource::Options options;
  options.give_up_s = arguments.give_up_s;
  return std::make_unique<ArDroneSource>(arguments.input, options);
}

Options readOptions(const TrackArguments &arguments, bool is_compressed)
{
  Options options;
  options.camera.compressed = is_compressed;
  if (!arguments.config.empty())
    readConfig(findPreset(arguments.config), options);
  setOptions(arguments.settings, options);
  if (arguments.camera_height > 0)
    options.camera.height = arguments.camera_height;
  return options;
}

/// [ms] since the last byte of a live frame came.
std::optional<double> ageOf(const Frame &frame)
{
  if (frame.arrival_ns == 0 || frame.status != FrameStatus::ok)
    return std::nullopt;
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return 1e-6 * static_cast<double>(std::chrono::nanoseconds(now).count() - frame.arrival_ns);
}

/// Frames of which nothing is known wait for one of which something is: at the end of a flight nobody
/// knows where the drone went.
class Flight
{
public:
  Flight(Pipeline &pipeline, TrackOutput &output, OverlayWindow &window)
      : m_pipeline(pipeline), m_output(output), m_window(window)
  {
  }

  void take(Frame frame)
  {
    if (frame.status == FrameStatus::missing && !frame.wMb_odometry) {
      m_silent.push_back(std::move(frame));
      return;
    }
    for (const Frame &silent : m_silent)
      process(silent);
    m_silent.clear();
    process(frame);
  }
  void finish()
  {
    m_output.addSilence(m_silent.size());
    m_pipeline.finish();
  }

private:
  void process(const Frame &frame)
  {
    const FrameReport report = m_pipeline.process(frame);
    m_window.show(m_output.add(frame, report, ageOf(frame)));
  }

  Pipeline &m_pipeline;
  TrackOutput &m_output;
  OverlayWindow &m_window;
  std::deque<Frame> m_silent;
};

/// The last lines. They come when all is on the disk.
void report(const TrackArguments &arguments, const TrackOutput &output, const Verdict &verdict)
{
  std::string text = fmt::format("{}{}\n{}", arguments.run, interrupted() ? " (interrupted)" : "", toText(verdict));
  if (const auto median = output.timing().age_ms(0.5))
    text +=
        fmt::format("  age of a frame when the map has it, from its last byte: median {:.1f} ms, 99 % below {:.1f} ms, "
                    "most {:.1f} ms\n",
                    *median, *output.timing().age_ms(0.99), *output.timing().age_ms(1));
  text += fmt::format("Look at {}{}/map.svg\n", output.hasVideo() ? arguments.run + "/overlay.mp4 and " : "",
                      arguments.run);
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

/// How the run is made, as far as that is known before it begins.
RunSummary describeRun(const TrackArguments &arguments)
{
  RunSummary made;
  std::error_code error;
  made.command = g_command_line;
  made.working_folder = std::filesystem::current_path(error).string();
  made.input = arguments.input;
  made.camera_file = arguments.source.camera_path;
  made.odometry_file = arguments.source.odometry_path;
  return made;
}

/// Frames from \p source until it ends, enough were taken, or somebody interrupts. Returns how many.
std::size_t fly(const TrackArguments &arguments, FrameSource &source, Pipeline &pipeline, TrackOutput &output,
                Flight &flight)
{
  constexpr std::size_t kKeepEvery = 50; // frames between two times that what is known is written
  Progress progress(arguments.is_quiet ? 0 : source.size(), stderr);
  std::size_t count = 0;
  while (!interrupted() && (arguments.frames_most == 0 || count < arguments.frames_most)) {
    Frame frame;
    if (!source.next(frame))
      break;
    if (arguments.is_without_odometry)
      frame.wMb_odometry.reset();
    if (arguments.is_without_gyro)
      frame.gyro.clear();
    const FrameStatus status = frame.status;
    flight.take(std::move(frame));
    ++count;
    if (!arguments.is_quiet)
      progress.update(count, fmt::format("{} trunks in view  {}", output.trunksInView(), toString(status)));
    if (count % kKeepEvery == 0)
      output.keep(pipeline);
  }
  return count;
}

void track(const TrackArguments &arguments)
{
  if (arguments.is_shown && std::getenv("DISPLAY") == nullptr)
    throw vpException(vpException::ioError, "--show: DISPLAY is not set, must name an X11 display");
  readOptions(arguments, false); // a mistake in them is said before the input is waited for
  RunSummary made = describeRun(arguments);
  const auto source = openInput(arguments, made);
  Options options = readOptions(arguments, source->isCompressed());
  const auto *live = dynamic_cast<const ArDroneSource *>(source.get());
  options.camera.focal_known = options.camera.focal_known && source->isCameraKnown();
  made.preset = arguments.config.empty() ? "default" : arguments.config;
  made.options = toYaml(options);
  if (!made.note.empty() && !arguments.is_quiet)
    std::fprintf(stderr, "bole: %s\n", made.note.c_str());

  StageOptions stages = stageOptions(options, source->camera());
  stages.flow.final_pass = live == nullptr && !arguments.is_online;
  Pipeline pipeline(source->camera(), source->bMc(), stages);
  TrackOutput output(arguments.run, made, *source, arguments.has_video, arguments.is_shown);
  OverlayWindow window(arguments.is_shown, "bole track");
  Flight flight(pipeline, output, window);
  endAtInterrupt();
  if (fly(arguments, *source, pipeline, output, flight) == 0) {
    if (interrupted())
      endWith(ExitCode::interrupted);
    throw vpException(vpException::ioError, "%s: no frames", arguments.input.c_str());
  }
  flight.finish();
  if (live != nullptr)
    output.setLink(live->counters());
  output.write(pipeline, !interrupted());
  output.finish();
  const Verdict verdict = output.verdict();
  if (!arguments.is_quiet)
    report(arguments, output, verdict);
  if (interrupted()) {
    std::fprintf(stderr, "bole: interrupted; what was known is in %s\n", arguments.run.c_str());
    endWith(ExitCode::interrupted);
  }
  if (!verdict.is_trusted)
    endWith(ExitCode::doubtful);
}
} // namespace

void addTrack(CLI::App &app)
{
  const auto arguments = std::make_shared<TrackArguments>();
  CLI::App *command = app.add_subcommand("track", "Map the trunks of a flight and smooth its trajectory");
  command
      ->add_option("INPUT", arguments->input,
                   "EuRoC/ASL folder, video file, numbered images (image%04d.png) or ardrone://HOST")
      ->transform(findSequence)
      ->required();
  command->add_option("-o,--output", arguments->run, "Folder for the results")->required();
  command->add_option("--config", arguments->config,
                      "YAML file of options, or a preset by its name (paper: the paper's method); `bole options` lists "
                      "them. Videos and live drones start with camera.compressed=true");
  command->add_option("--set", arguments->settings, "One option, e.g. --set detection.window=30");
  command->add_option("--camera", arguments->source.camera_path, "Camera: EuRoC sensor.yaml or ViSP XML");
  command->add_option("--odometry", arguments->source.odometry_path,
                      "Poses for a video: TUM or ASL csv; `none` withholds odometry and gyro");
  command
      ->add_option("--odometry-offset", arguments->source.odometry_offset_s,
                   "Added to the stamps of --odometry so that they count as the video's do [s]")
      ->capture_default_str()
      ->check(within(-1e10, 1e10));
  CLI::Option *view =
      command->add_option("--field-of-view", arguments->source.field_of_view_deg,
                          "Horizontal, where there is no camera file [degrees]; else a pan in the video "
                          "tells it, or 65 is assumed");
  command
      ->add_option("--camera-height", arguments->camera_height,
                   "Height of the camera over the ground [m], which gives a video without odometry its scale")
      ->check(within(0.1, 100));
  const auto without = std::make_shared<std::vector<std::string>>();
  command->add_option("--without", *without, "Withhold one sensor: gyro or odometry (may be given twice)")
      ->check(CLI::IsMember({"gyro", "odometry"}));
  command->add_option("--rate", arguments->source.frame_rate_hz, "Frames a second of numbered images")
      ->capture_default_str();
  command->add_option("--max-width", arguments->source.max_width_px, "Wider frames are made smaller [px]")
      ->capture_default_str();
  command->add_option("--frames", arguments->frames_most, "Stop after so many frames (0: all)")->check(within(0, 1e9));
  command->add_option("--give-up", arguments->give_up_s, "Silence of a live drone that ends its flight [s]")
      ->capture_default_str()
      ->check(within(0.1, 86400));
  command->add_flag("--online", arguments->is_online,
                    "Decide the map by what is known while it flies, as a live drone does; else all frames of a file "
                    "are asked once more at the end");
  command->add_flag("--show", arguments->is_shown, "Show the overlay in a window (X11)");
  command->add_flag("!--no-video", arguments->has_video, "Write no overlay.mp4 and saliency.mp4");
  command->add_flag("-q,--quiet", arguments->is_quiet, "Nothing but errors; the exit status tells how it went");
  command->footer("Writes trajectory.tum, trajectory_online.tum, trunks.csv, hypotheses.csv, graph.g2o, overlay.mp4, "
                  "saliency.mp4,\n"
                  "map.svg, timing.csv, options.yaml and summary.json to the folder; Ctrl-C ends the flight and keeps "
                  "what is known.\n"
                  "Exit status: 0 good; 1 error; 2 unknown option; 3 not to be trusted (the camera never moved, only "
                  "rotated, or saw\n"
                  "nothing: summary.json tells); 130 interrupted.\n"
                  "Examples:\n"
                  "  bole track data/park-forward -o run\n"
                  "  bole track walk.mp4 -o run --camera phone.yaml --show\n"
                  "  bole track data/park-forward -o run --odometry none --camera-height 1.6\n"
                  "  bole track frames/%05d.jpg -o run --rate 25 --config config/default.yaml\n"
                  "  bole track ardrone://192.168.1.1 -o run --show");
  command->callback([arguments, view, without] {
    for (const std::string &sensor : *without)
      (sensor == "gyro" ? arguments->is_without_gyro : arguments->is_without_odometry) = true;
    arguments->is_field_of_view_given = view->count() > 0;
    if (arguments->source.odometry_path == "none") {
      arguments->is_without_odometry = arguments->is_without_gyro = true;
      arguments->source.odometry_path.clear();
    }
    track(*arguments);
  });
}
} // namespace bole::apps
