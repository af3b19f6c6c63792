// SPDX-License-Identifier: GPL-2.0-or-later
#include "track_arguments.h"
#include "data_files.h"
#include "input_checks.h"

namespace bole::apps
{
void addTrackOptions(CLI::App &command, const std::shared_ptr<TrackArguments> &arguments)
{
  command
      .add_option(
          "INPUT", arguments->input,
          "EuRoC/ASL folder, video file, numbered images (image%04d.png), ardrone://HOST, a camera (/dev/video0) "
          "or an address (rtsp://, http://)")
      ->transform(findSequence);
  command.add_option("-o,--output", arguments->run, "Folder for the results");
  command.add_option("--config", arguments->config,
                     "YAML file of options, or a preset by its name (paper: the paper's method); `bole options` lists "
                     "them. Videos and live drones start with camera.compressed=true");
  command.add_option("--set", arguments->settings, "One option, e.g. --set detection.window=30");
  command.add_option("--camera", arguments->source.camera_path,
                     "Camera: EuRoC, OpenCV, ROS or Kalibr YAML, or ViSP XML");
  command.add_option("--odometry", arguments->source.odometry_path,
                     "Poses for a video: TUM or ASL csv; `none` withholds odometry and gyro");
  command
      .add_option("--odometry-offset", arguments->source.odometry_offset_s,
                  "Added to the stamps of --odometry so that they count as the video's do [s]")
      ->capture_default_str()
      ->check(within(-1e10, 1e10));
  command.add_option("--field-of-view", arguments->source.field_of_view_deg,
                     "Horizontal, where there is no camera file [degrees]; else a pan in the video "
                     "tells it, or 65 is assumed");
  command
      .add_option(
          "--camera-height", arguments->camera_height,
          "Mean height of the camera over the ground in the flight [m], which gives a video without odometry its "
          "scale")
      ->check(within(0.1, 100));
  command.add_option("--without", arguments->without, "Withhold one sensor: gyro or odometry (may be given twice)")
      ->check(CLI::IsMember({"gyro", "odometry"}));
  command.add_option("--rate", arguments->source.frame_rate_hz,
                     "Frames a second of numbered images; else the camera file's rate_hz, else 25");
  command.add_option("--max-width", arguments->source.max_width_px, "Wider frames are made smaller [px]")
      ->capture_default_str();
  command.add_option("--frames", arguments->frames_most, "Stop after so many frames (0: all)")->check(within(0, 1e9));
  command.add_option("--give-up", arguments->give_up_s, "Silence of a live drone or stream that ends its flight [s]")
      ->capture_default_str()
      ->check(within(0.1, 86400));
  command.add_option("--again", arguments->again,
                     "Repeat the run in this folder and tell whether its trunks.csv and trajectory.tum come out the "
                     "same, byte by byte");
  command.add_option("--resume", arguments->resumed,
                     "Complete the run in this folder, which was interrupted or killed: it is made anew from its first "
                     "frame with the options it had, to the same bytes as if it had never been broken off");
  command.add_flag("--show", arguments->is_shown, "Show the overlay in a window (X11)");
  command.add_flag("!--no-video", arguments->has_video, "Write no overlay.mp4 and saliency.mp4");
  command.add_flag("--online", arguments->is_online,
                   "The map as it was known in flight: no second look at all frames at the end");
  command.add_flag("--profile", arguments->is_profiled, "Tell at the end what each stage of a frame cost");
  command.add_flag("-q,--quiet", arguments->is_quiet, "Nothing but errors; the exit status tells how it went");
  command.footer("Writes trajectory.tum, trajectory_online.tum, trunks.csv, hypotheses.csv, graph.g2o, overlay.mp4, "
                 "saliency.mp4,\n"
                 "map.svg, report.html, frames.csv, views.csv, evidence.csv, views/, timing.csv, options.yaml and "
                 "summary.json\nto the folder; Ctrl-C ends the flight and keeps "
                 "what is known.\n"
                 "Exit status: 0 good; 1 error; 2 unknown option; 3 not to be trusted (the camera never moved, only "
                 "rotated, or saw\n"
                 "nothing: summary.json tells); 130 interrupted.\n"
                 "Examples:\n"
                 "  bole track data/park-forward -o run\n"
                 "  bole track walk.mp4 -o run --camera phone.yaml --show\n"
                 "  bole track data/park-forward -o run --odometry none --camera-height 1.6\n"
                 "  bole track frames/%05d.jpg -o run --rate 25 --config config/default.yaml\n"
                 "  bole track ardrone://192.168.1.1 -o run --show\n"
                 "  bole track --again run\n"
                 "  bole track --resume run");
}

void settle(const CLI::App &command, TrackArguments &arguments)
{
  for (const char *needed : {"INPUT", "--output"})
    if (command.count(needed) == 0)
      throw CLI::RequiredError(needed);
  requireGiveUpUsed(command, arguments.input);
  for (const std::string &sensor : arguments.without)
    (sensor == "gyro" ? arguments.is_without_gyro : arguments.is_without_odometry) = true;
  if (arguments.source.odometry_path == "none") {
    arguments.is_without_odometry = arguments.is_without_gyro = true;
    arguments.source.odometry_path.clear();
  }
}
} // namespace bole::apps
