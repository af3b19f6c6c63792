// SPDX-License-Identifier: GPL-2.0-or-later
// bole track: from a flight through trees to a map of trunks and a trajectory.
#include "commands.h"
#include "data_files.h"
#include "geometry/failure.h"
#include "input_checks.h"
#include "overlay_window.h"
#include "track_arguments.h"
#include "track_output.h"
#include "worker.h"

#include "input/live_video.h"
#include "input/user_text.h"
#include "motion/sensor_calibration.h"
#include "pipeline/measured_camera.h"
#include "progress.h"
#include "report/report_page.h"
#include <bole/ardrone_source.h>
#include <bole/config.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fmt/format.h>
#include <future>
#include <memory>
#include <optional>

namespace bole::apps
{
namespace
{
/// As it is given, or as the video tells its field of view; \p arguments open the same once more.
std::unique_ptr<FrameSource> openVideo(TrackArguments &arguments, RunSummary &made)
{
  MeasuredSource opened = openMeasured(arguments.input, arguments.source, arguments.give_up_s);
  requireHeightUsed(arguments.is_without_odometry ? 0 : arguments.camera_height, *opened.source);
  arguments.source = opened.options;
  made.note = opened.note;
  made.is_camera_known = opened.is_camera_known;
  made.field_of_view_sigma_deg = opened.field_of_view_sigma_deg;
  return std::move(opened.source);
}

/// A recording, without the constant errors of its sensors. \p arguments open it once more.
std::unique_ptr<FrameSource> openRecording(TrackArguments &arguments, const Options &options, RunSummary &made,
                                           SensorCalibration &calibration)
{
  auto source = openVideo(arguments, made);
  const bool is_stream = LiveVideoSource::accepts(arguments.input); // cannot be looked through twice
  if (is_stream || !options.stages.calibration || !options.stages.points)
    return source;
  const bool is_known = source->isCameraKnown(); // by a guess sensors cannot be measured
  calibration =
      calibrateSensors(*source, is_known && !arguments.is_without_gyro, is_known && !arguments.is_without_odometry);
  made.calibration = calibration.constants;
  arguments.source.calibration = calibration;
  return openSource(arguments.input, arguments.source);
}

/// What is left open of the constants that were taken out.
void widen(Options::Odometry &odometry, const SensorCalibration &calibration)
{
  odometry.tilt = std::hypot(odometry.tilt, calibration.odometry_rotation_sigma);
  odometry.turn = std::hypot(odometry.turn, calibration.odometry_rotation_sigma);
  odometry.scale = std::hypot(odometry.scale, calibration.odometry_scale_sigma);
}

std::unique_ptr<FrameSource> openInput(TrackArguments &arguments, const Options &options, RunSummary &made,
                                       SensorCalibration &calibration)
{
  if (!ArDroneSource::accepts(arguments.input))
    return openRecording(arguments, options, made, calibration);
  requireUsed(arguments.source, arguments.input, kDrone);
  ArDroneSource::Options link;
  link.give_up_s = arguments.give_up_s;
  link.max_width_px = arguments.source.max_width_px;
  auto source = std::make_unique<ArDroneSource>(arguments.input, link);
  requireHeightUsed(arguments.is_without_odometry ? 0 : arguments.camera_height, *source);
  return source;
}

Options readOptions(const TrackArguments &arguments, bool is_compressed)
{
  Options options;
  options.camera.compressed = is_compressed;
  if (!arguments.config.empty())
    readConfig(findPreset(arguments.config), options);
  setOptions(arguments.settings, options);
  if (arguments.is_online)
    options.stages.final_pass = false;
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

/// Goes through the frames of a recording once more, with the map that they have led to.
void showAgain(const TrackArguments &arguments, const Pipeline &pipeline, TrackOutput &output)
try {
  const std::size_t frames = pipeline.smoothedTrajectory().size();
  const auto source = openSource(arguments.input, arguments.source);
  Frame frame;
  for (std::size_t i = 0; i < frames && source->next(frame); ++i)
    output.showAgain(frame, pipeline.review(i));
}
catch (const vpException &error) { // whoever took the recording away has not taken what came of it
  std::fprintf(stderr, "bole: no pictures of the map: %s\n", error.what());
}

/// The last lines. They come when all is on the disk.
void report(const TrackArguments &arguments, const TrackOutput &output, const Verdict &verdict, bool is_interrupted)
{
  std::string text = fmt::format("{}{}\n{}", arguments.run, is_interrupted ? " (interrupted)" : "", toText(verdict));
  if (const auto median = output.timing().age_ms(0.5))
    text +=
        fmt::format("  age of a frame when the map has it, from its last byte: median {:.1f} ms, 99 % below {:.1f} ms, "
                    "most {:.1f} ms\n",
                    *median, *output.timing().age_ms(0.99), *output.timing().age_ms(1));
  text += fmt::format("Look at {}/report.html\n", arguments.run);
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
  made.input = withoutSecrets(arguments.input);
  made.camera_file = arguments.source.camera_path;
  made.odometry_file = arguments.source.odometry_path;
  return made;
}

/// The next frame, nothing at the end. One that waits in a file is read while the one before is worked on; a live one
/// is as new as it can be.
std::future<std::optional<Frame>> nextOf(FrameSource &source, bool is_live, Worker &reader)
{
  const auto read = [&source]() -> std::optional<Frame> {
    Frame frame;
    return source.next(frame) ? std::optional<Frame>(std::move(frame)) : std::nullopt;
  };
  return is_live ? std::async(std::launch::deferred, read) : reader(read);
}

/// Frames from \p source until it ends, enough were taken, or somebody interrupts. Returns how many.
std::size_t fly(const TrackArguments &arguments, FrameSource &source, bool is_live, Pipeline &pipeline,
                TrackOutput &output, Flight &flight)
{
  constexpr std::size_t kKeepEvery = 50; // frames between two times that what is known is written, at least
  Progress progress(arguments.is_quiet ? 0 : source.size(), stderr);
  std::size_t count = 0, keep_at = 1;
  Worker reader;
  auto next = nextOf(source, is_live, reader);
  while (!interrupted() && next.valid()) {
    std::optional<Frame> frame = next.get();
    if (!frame)
      break;
    ++count;
    if (arguments.frames_most == 0 || count < arguments.frames_most)
      next = nextOf(source, is_live, reader);
    if (arguments.is_without_odometry)
      frame->wMb_odometry.reset();
    if (arguments.is_without_gyro)
      frame->gyro.clear();
    const FrameStatus status = frame->status;
    flight.take(std::move(*frame));
    if (!arguments.is_quiet)
      progress.update(count, fmt::format("{} trunks in view  {}", output.trunksInView(), toString(status)));
    if (count >= keep_at) {
      output.keep(pipeline);
      keep_at = count - count % kKeepEvery + std::max(kKeepEvery, count / 10); // a long flight has much to write
    }
  }
  return count;
}

} // namespace

void track(const TrackArguments &asked_for)
{
  TrackArguments arguments = asked_for;
  if (arguments.is_shown && std::getenv("DISPLAY") == nullptr)
    throw ioError("--show: DISPLAY is not set, must name an X11 display");
  const Options asked = readOptions(arguments, false); // a mistake in them is said before the input is waited for
  RunSummary made = describeRun(arguments);
  SensorCalibration calibration;
  const auto source = openInput(arguments, asked, made, calibration);
  for (const SensorVerdict &verdict : calibration.verdicts) {
    arguments.is_without_gyro = arguments.is_without_gyro || verdict.sensor == "gyro";
    arguments.is_without_odometry = arguments.is_without_odometry || verdict.sensor == "odometry";
  }
  made.sensors = calibration.verdicts;
  Options options = readOptions(arguments, source->isCompressed());
  const auto *live = dynamic_cast<const ArDroneSource *>(source.get());
  const bool is_live = live != nullptr || dynamic_cast<const LiveVideoSource *>(source.get()) != nullptr;
  if (options.camera.focal_sigma == 0)
    options.camera.focal_sigma = focalSigma(*source, made.is_camera_known, made.field_of_view_sigma_deg);
  made.preset = arguments.config.empty() ? "default" : arguments.config;
  made.options = toYaml(options);
  widen(options.odometry, calibration);
  if (!made.note.empty() && !arguments.is_quiet)
    std::fprintf(stderr, "bole: %s\n", made.note.c_str());
  for (const std::string &sensor : arguments.without)
    if (!arguments.is_quiet && !(sensor == "gyro" ? source->hasGyro() : source->hasOdometry()))
      std::fprintf(stderr, "bole: --without %s has no effect: there is none\n", sensor.c_str());

  Pipeline pipeline(source->camera(), source->bMc(), options);
  const bool is_shown_again = !is_live && !arguments.is_online && options.map.lag == 0;
  endAtInterrupt(); // before there is something to keep
  TrackOutput output(arguments.run, made, *source, arguments.has_video, arguments.is_shown, is_shown_again);
  OverlayWindow window(arguments.is_shown, "bole track");
  Flight flight(pipeline, output, window);
  if (fly(arguments, *source, is_live, pipeline, output, flight) == 0) {
    if (interrupted())
      endWith(ExitCode::interrupted);
    throw ioError("{}: no frames", arguments.input);
  }
  const bool is_interrupted = interrupted(); // from here on the run is completed, whoever goes away
  if (!arguments.is_cut)
    flight.finish();
  if (is_shown_again)
    showAgain(arguments, pipeline, output);
  if (live != nullptr)
    output.setLink(live->counters());
  output.write(pipeline, !is_interrupted);
  output.finish();
  try {
    writeReport(arguments.run, output.hasTruth() ? arguments.input : "");
  }
  catch (const vpException &error) { // a picture of what is there already
    std::fprintf(stderr, "bole: no page: %s\n", error.what());
  }
  const Verdict verdict = output.verdict();
  if (!arguments.is_quiet)
    report(arguments, output, verdict, is_interrupted);
  if (arguments.is_profiled)
    std::fputs(toText(output.timing()).c_str(), stdout);
  if (is_interrupted) {
    std::fprintf(stderr, "bole: interrupted; what was known is in %s\n", arguments.run.c_str());
    endWith(ExitCode::interrupted);
  }
  if (!verdict.is_trusted)
    endWith(ExitCode::doubtful);
}
void addTrack(CLI::App &app)
{
  const auto arguments = std::make_shared<TrackArguments>();
  CLI::App *command = app.add_subcommand("track", "Map the trunks of a flight and smooth its trajectory");
  addTrackOptions(*command, arguments);
  command->callback([arguments, command] {
    if (!arguments->again.empty())
      return trackAgain(*command, *arguments);
    if (!arguments->resumed.empty())
      return resume(*command, *arguments);
    settle(*command, *arguments);
    track(*arguments);
  });
}
} // namespace bole::apps
