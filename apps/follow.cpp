// SPDX-License-Identifier: GPL-2.0-or-later
// The module bole_commands.so (command_module.h): bole follow, vpMbTrunkTracker over a video of one's own in the map of
// an earlier flight, and the window that shows an overlay.
#include "commands.h"
#include "data_files.h"
#include "geometry/failure.h"
#include "input_checks.h"
#include "localise.h"
#include "overlay_window.h"

#include "geometry/so3.h"
#include "geometry/visp_matrix.h"
#include "input/atomic_file.h"
#include "input/csv_reader.h"
#include "input/live_video.h"
#include "input/trajectory.h"
#include "input/user_text.h"
#include "mbt/model_files.h"
#include "output/summary_json.h"
#include "output/video_writer.h"
#include "progress.h"
#include <bole/cylinder.h>
#include <bole/open_source.h>
#include <bole/output_folder.h>
#include <bole/overlay.h>
#include <bole/vpMbTrunkTracker.h>

#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <visp3/core/vpException.h>
#include <visp3/gui/vpDisplayX.h>

namespace bole::apps
{
namespace
{
namespace fs = std::filesystem;
using Eigen::Vector3d;

struct FollowArguments
{
  std::string input, model, init = "map", settings, folder;
  SourceOptions source;
  double camera_height = 0, give_up_s = 10;
  std::size_t frames_most = 0;
  bool is_shown = false, has_video = true, is_quiet = false;
};

/// X,Y,Z,YAW of a level body [m, degrees].
std::optional<Pose> readPose(const std::string &text)
{
  std::vector<double> values;
  for (const std::string &word : CLI::detail::split(text, ',')) {
    double value = 0;
    if (!CLI::detail::lexical_cast(word, value) || !std::isfinite(value))
      return std::nullopt;
    values.push_back(value);
  }
  if (values.size() != 4)
    return std::nullopt;
  return Pose(expSo3({0, 0, values[3] * M_PI / 180}), {values[0], values[1], values[2]});
}

/// The first pose by clicking on the points of MODEL.init, as with any tracker of ViSP.
void clickFirstPose(vpMbTrunkTracker &tracker, const FollowArguments &arguments, vpImage<unsigned char> image)
{
  const vpDisplayX display(image, 100, 100, "bole follow: click on the points of the model");
  vpDisplay::display(image);
  vpDisplay::flush(image);
  tracker.initClick(image, fs::path(arguments.model).replace_extension(".init").string(), true);
}

/// How well a flight knows its own motion, in the axes of the world: x, y, z [m] and the turns about them [rad].
struct MotionError
{
  Vector6d per_second; ///< variances that the step between two frames gains a second
  Vector6d absolute;   ///< standard deviations of what does not drift: height, roll and pitch
};
constexpr double kUnknown = 1e3;

MotionError motionError(double xy, double z, double tilt, double yaw, double height, double level)
{
  const Vector6d step = (Vector6d() << xy, xy, z, tilt, tilt, yaw).finished();
  return {step.cwiseAbs2(), (Vector6d() << kUnknown, kUnknown, height, level, level, kUnknown).finished()};
}
/// The pose filter of a small drone: 0.013 m and 0.1 degrees of yaw a tenth of a second; sonar and gravity.
const MotionError kPoseFilter = motionError(0.04, 0.1, 0.02, 0.006, 0.02, 0.005);
/// Point features and the scale that they know.
const MotionError kPoints = motionError(0.1, 0.1, 0.02, 0.02, 0.1, 0.02);
/// Point features where the translation is not seen.
const MotionError kTurnsAlone = motionError(0.4, 0.4, 0.02, 0.02, 0.3, 0.02);

/// Where the camera is by its own motion, in a world that drifts.
struct OwnPose
{
  Pose wMc;
  MotionError error;
  double time_s = 0;
  bool has_height = false; ///< its z is that over the ground
};

/// The tracker, and what carries its pose from frame to frame.
class Follower
{
public:
  Follower(const FollowArguments &arguments, const PinholeCamera &camera) : m_arguments(arguments)
  {
    if (!arguments.settings.empty())
      m_tracker.loadConfigFile(findModel(arguments.settings), false);
    m_tracker.setCameraParameters(camera.toVisp());
    m_tracker.loadModel(arguments.model);
  }

  bool isStarted() const { return m_is_started; }
  const vpMbTrunkTracker &tracker() const { return m_tracker; }

  void start(const vpImage<unsigned char> &image, const std::optional<Pose> &wMc, const OwnPose &own)
  {
    if (wMc)
      m_tracker.initFromPose(image, wMc->inverse().toVisp());
    else
      clickFirstPose(m_tracker, m_arguments, image);
    m_is_started = true;
    m_last = own;
    m_height = this->wMc().t.z() - own.wMc.t.z();
  }

  /// What is known by now of the camera's pose at the last frame: points find their scale as they go.
  void correctLast(const Trajectory &flight, const Pose &bMc)
  {
    for (auto pose = flight.rbegin(); pose != flight.rend(); ++pose)
      if (1e-9 * static_cast<double>(pose->stamp_ns) <= m_last.time_s + 1e-6) {
        m_last.wMc = pose->wMb * bMc;
        return;
      }
  }

  /// Follows into \p image, to which the camera came by \p own. Where its step leads counts from the last pose on the
  /// model, with its height, roll and pitch from \p own: they do not drift.
  void follow(const vpImage<unsigned char> &image, const OwnPose &own)
  {
    const Pose before = wMc();
    const Eigen::Matrix3d turn = expSo3({0, 0, headingOf(before) - headingOf(m_last.wMc)});
    Pose now(turn * own.wMc.R, before.t + turn * (own.wMc.t - m_last.wMc.t));
    if (own.has_height)
      now.t.z() = own.wMc.t.z() + m_height;
    const Matrix6d carry = adjoint(now.inverse() * before);
    Matrix6d axes = Matrix6d::Zero(); // of the world to the camera's
    axes.topLeftCorner<3, 3>() = axes.bottomRightCorner<3, 3>() = now.R.transpose();
    const double dt = std::max(own.time_s - m_last.time_s, 1e-3);
    const Matrix6d drifted = carry * toEigen(m_tracker.getPoseCovariance()) * carry.transpose() +
                             axes * (dt * own.error.per_second).asDiagonal() * axes.transpose();
    const Matrix6d known = axes * own.error.absolute.cwiseAbs2().cwiseInverse().asDiagonal() * axes.transpose();
    const Matrix6d covariance = (drifted.inverse() + known).inverse();
    m_tracker.setMotionPrior(now.inverse().toVisp(), toVisp(0.5 * (covariance + covariance.transpose())));
    m_last = own;
    try {
      m_tracker.track(image);
    }
    catch (const vpException &error) { // getStatus() tells
      m_message = error.getStringMessage();
      return;
    }
    m_message = m_tracker.getMessage();
  }

  Pose wMc() const { return Pose::fromVisp(m_tracker.getPose()).inverse(); }
  bool isHeld() const
  {
    const auto status = m_tracker.getStatus();
    return status == vpMbTrunkTracker::Status::tracked || status == vpMbTrunkTracker::Status::partly_on_prior;
  }
  const std::string &message() const { return m_message; }

private:
  static double headingOf(const Pose &wMc) { return std::atan2(wMc.R(1, 2), wMc.R(0, 2)); }

  const FollowArguments &m_arguments;
  vpMbTrunkTracker m_tracker;
  bool m_is_started = false;
  OwnPose m_last;
  double m_height = 0; ///< of the model's world over that of the own motion [m]
  std::string m_message;
};

/// What of the model the camera should see.
std::vector<TrunkInView> modelInView(const std::vector<Cylinder> &model, const Pose &cMo, const PinholeCamera &camera,
                                     bool is_held)
{
  constexpr double kThinnest_px = 3;
  std::vector<TrunkInView> trunks;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const Cylinder trunk = cMo * model[i];
    TrunkInView drawn;
    drawn.relative = relativeTrunk(trunk);
    if (!drawn.relative.isFinite() || drawn.relative.cRt(2, 0) <= 0.1 ||
        2 * camera.fx * drawn.relative.ratio() < kThinnest_px)
      continue;
    drawn.id = static_cast<int>(i);
    drawn.distance = trunk.radius / drawn.relative.ratio();
    drawn.tan_low = drawn.relative.cRt.col(2).dot(trunk.foot) / drawn.distance;
    drawn.tan_high = drawn.relative.cRt.col(2).dot(trunk.top) / drawn.distance;
    drawn.status = TrunkStatus::confirmed;
    drawn.is_tracked = is_held;
    trunks.push_back(drawn);
  }
  return trunks;
}

/// status.csv and trajectory.tum, which grow with each frame; overlay.mp4 and follow.json at the end.
class FollowOutput
{
public:
  FollowOutput(const FollowArguments &arguments, const PinholeCamera &camera, const Pose &bMc)
      : m_arguments(arguments),
        m_camera(camera),
        m_cMb(bMc.inverse()),
        m_model(readTrunkModel(arguments.model)),
        m_window(arguments.is_shown, "bole follow"),
        m_folder(arguments.folder, {"follow.json", "status.csv", "trajectory.tum", "overlay.mp4"}),
        m_status(m_folder.file("status.csv"),
                 "frame,timestamp,status,x,y,z,sigma,sigma_rotation,message\n# units,s,,m,m,m,m,deg,\n"),
        m_trajectory(m_folder.file("trajectory.tum"), kTrajectoryHead)
  {
    writeRecord(false);
    if (arguments.has_video)
      m_video = std::make_unique<VideoWriter>(m_folder.file("overlay.mp4"));
  }

  void add(const Frame &frame, const Follower &follower, bool is_followed)
  {
    ++m_frames;
    const double time_s = 1e-9 * static_cast<double>(frame.stamp_ns);
    m_first_s = m_first_s.value_or(time_s);
    std::string status = toString(frame.status), place = ",,,,", message = frame.message;
    const bool is_used = frame.status == FrameStatus::ok;
    const bool is_held = is_followed && follower.isHeld();
    if (is_used) {
      status = is_followed            ? vpMbTrunkTracker::toString(follower.tracker().getStatus())
               : follower.isStarted() ? "no odometry"
                                      : "not placed yet";
      message = is_followed ? follower.message() : "";
    }
    if (follower.isStarted()) {
      m_started_frames += 1;
      m_started_s = m_started_s.value_or(time_s - *m_first_s);
    }
    if (is_held) {
      const Matrix6d P = toEigen(follower.tracker().getPoseCovariance());
      const Pose wMb = follower.wMc() * m_cMb;
      m_trajectory.add(trajectoryLine({frame.stamp_ns, wMb}));
      ++m_followed;
      place = fmt::format("{:.4f},{:.4f},{:.4f},{:.4f},{:.3f}", wMb.t.x(), wMb.t.y(), wMb.t.z(),
                          std::sqrt(P.topLeftCorner<3, 3>().trace()),
                          std::sqrt(P.bottomRightCorner<3, 3>().trace()) * 180 / M_PI);
    }
    ++m_counts[status];
    m_status.add(fmt::format("{},{:.6f},{},{},{}\n", frame.index, time_s, status, place, csvField(message)));
    draw(frame, follower, is_held, status);
  }

  /// Ends the files; whether the result is to be trusted.
  bool finish(bool is_complete)
  {
    if (m_video)
      m_video->finish();
    writeRecord(is_complete);
    return isTrusted();
  }
  void writeRecord(bool is_complete) const
  {
    nlohmann::ordered_json json{{"command", g_command_line},  {"input", withoutSecrets(m_arguments.input)},
                                {"model", m_arguments.model}, {"trunks", m_model.size()},
                                {"frames", m_frames},         {"followed", m_followed},
                                {"complete", is_complete}};
    json["first_pose_s"] = m_started_s ? nlohmann::ordered_json(*m_started_s) : nullptr;
    json["frames_by_status"] = m_counts;
    json["trusted"] = isTrusted();
    json["versions"] = versions();
    writeAtomically(m_folder.file("follow.json"), json.dump(1) + "\n");
  }

  std::string text() const
  {
    if (!m_started_s)
      return "not placed on the map: too few of its trunks were seen, or they look the same in several places";
    return fmt::format("first pose after {:.1f} s, followed in {} of the {} frames since{}", *m_started_s, m_followed,
                       m_started_frames, isTrusted() ? "" : ": not to be trusted");
  }
  std::size_t frames() const { return m_frames; }

private:
  bool isTrusted() const { return m_started_s && 2 * m_followed >= m_started_frames; }

  void draw(const Frame &frame, const Follower &follower, bool is_held, const std::string &status)
  {
    if (!m_video && !m_arguments.is_shown)
      return;
    Overlay overlay;
    if (follower.isStarted())
      overlay.trunks = modelInView(m_model, follower.wMc().inverse(), m_camera, is_held);
    overlay.text = fmt::format("{}  {}", frame.index, status);
    overlay.is_warning = !is_held;
    const vpImage<vpRGBa> picture = drawOverlay(frame.image, m_camera, overlay);
    if (m_video)
      m_video->write(picture, frame.stamp_ns);
    m_window.show(picture);
  }

  const FollowArguments &m_arguments;
  PinholeCamera m_camera;
  Pose m_cMb;
  std::vector<Cylinder> m_model;
  OverlayWindow m_window;
  OutputFolder m_folder;
  GrowingFile m_status, m_trajectory;
  std::unique_ptr<VideoWriter> m_video;
  std::size_t m_frames = 0, m_started_frames = 0, m_followed = 0;
  std::optional<double> m_first_s, m_started_s;
  std::map<std::string, std::size_t> m_counts;
};

/// Where the camera is by the pose filter, else by the points of the map that the flight makes itself.
OwnPose ownPose(const Frame &frame, const FrameReport *report, const Pose &bMc)
{
  const double time_s = 1e-9 * static_cast<double>(frame.stamp_ns);
  if (frame.wMb_odometry)
    return {*frame.wMb_odometry * bMc, kPoseFilter, time_s, true};
  if (report == nullptr) // a frame that the odometry leaves out
    return {Pose(), kTurnsAlone, time_s};
  return {report->wMc, report->has_ranges && report->is_translation_seen ? kPoints : kTurnsAlone, time_s};
}

void follow(const FollowArguments &arguments)
{
  const std::optional<Pose> given = readPose(arguments.init);
  const bool is_click = arguments.init == "click", is_map = arguments.init == "map";
  if (!given && !is_click && !is_map)
    throw badValue("--init = {}, must be X,Y,Z,YAW, click or map", arguments.init);
  if ((arguments.is_shown || is_click) && std::getenv("DISPLAY") == nullptr)
    throw ioError("{}: DISPLAY is not set, must name an X11 display", is_click ? "--init click" : "--show");
  const std::unique_ptr<FrameSource> source = LiveVideoSource::accepts(arguments.input)
                                                  ? openStream(arguments.input, arguments.source, arguments.give_up_s)
                                                  : openSource(arguments.input, arguments.source);
  if (!source->note().empty() && !arguments.is_quiet)
    fmt::print(stderr, "bole: {}\n", source->note());
  requireHeightUsed(arguments.camera_height, *source);
  const Pose bMc = source->bMc();
  Follower follower(arguments, source->camera());
  // A flight without a pose filter is mapped as it goes: its point features carry the tracker from frame to frame.
  std::optional<Localiser> localiser;
  if (is_map)
    localiser.emplace(readKnownMap(arguments.model), *source, arguments.camera_height);
  else if (!source->hasOdometry())
    localiser.emplace(std::vector<TrunkRecord>(), *source, arguments.camera_height);
  FollowOutput output(arguments, source->camera(), bMc);
  endAtInterrupt();
  Progress progress(arguments.is_quiet ? 0 : source->size(), stderr);
  for (Frame frame; !interrupted() && (arguments.frames_most == 0 || output.frames() < arguments.frames_most) &&
                    source->next(frame);) {
    bool is_followed = false;
    std::optional<FrameReport> report;
    if (localiser && !(follower.isStarted() && source->hasOdometry()))
      report = localiser->process(frame);
    if (frame.status == FrameStatus::ok && (frame.wMb_odometry || report)) {
      OwnPose own = ownPose(frame, report ? &*report : nullptr, bMc);
      if (!frame.wMb_odometry && follower.isStarted()) {
        const Trajectory flight = localiser->smoothed();
        own.wMc = flight.back().wMb * bMc;
        follower.correctLast(flight, bMc);
      }
      std::optional<Pose> first = given ? std::optional(*given * bMc) : std::nullopt;
      if (!follower.isStarted() && is_map && localiser->placement())
        first = localiser->onMap(report->wMb) * bMc;
      if (!follower.isStarted() && (first || is_click))
        follower.start(frame.image, first, own);
      is_followed = follower.isStarted();
      if (is_followed)
        follower.follow(frame.image, own);
    }
    output.add(frame, follower, is_followed);
    if (!arguments.is_quiet)
      progress.update(output.frames(), follower.isStarted() ? vpMbTrunkTracker::toString(follower.tracker().getStatus())
                                                            : "not placed yet");
  }
  progress.finish();
  if (output.frames() == 0)
    throw ioError("{}: no frames", arguments.input);
  const bool is_trusted = output.finish(!interrupted());
  if (!arguments.is_quiet)
    fmt::print("{}{}: {}\n", arguments.folder, interrupted() ? " (interrupted)" : "", output.text());
  if (interrupted())
    endWith(ExitCode::interrupted);
  if (!is_trusted)
    endWith(ExitCode::doubtful);
}
} // namespace

void addFollow(CLI::App &app)
{
  const auto arguments = std::make_shared<FollowArguments>();
  CLI::App *command = app.add_subcommand("follow", "Follow a video in a known map of trunks (vpMbTrunkTracker)");
  command
      ->add_option("INPUT", arguments->input,
                   "EuRoC/ASL folder, video, numbered images, /dev/video0, or an address (rtsp://, http://)")
      ->transform(findSequence)
      ->required();
  command->add_option("--model", arguments->model, "Map: a .cao model of cylinders (`bole export RUN cao`)")
      ->check(CLI::ExistingFile)
      ->required();
  command
      ->add_option(
          "--init", arguments->init,
          "First pose. map: where the trunks that the flight maps itself stand in the model; X,Y,Z,YAW: of the "
          "level body in the model's frame [m, degrees]; click: on the points of the model's .init file, in a "
          "window, as with ViSP's trackers")
      ->capture_default_str();
  command->add_option("-o,--output", arguments->folder, "Folder for the results")->required();
  command->add_option("--settings", arguments->settings, "XML settings of the tracker (models/*.xml)");
  command->add_option("--camera", arguments->source.camera_path,
                      "Camera: EuRoC, OpenCV, ROS or Kalibr YAML, or ViSP XML");
  command->add_option("--odometry", arguments->source.odometry_path, "Poses for a video: TUM or ASL csv");
  command->add_option("--field-of-view", arguments->source.field_of_view_deg,
                      "Horizontal, where there is no camera file [degrees]");
  command
      ->add_option("--camera-height", arguments->camera_height,
                   "Mean height of the camera over the ground [m], which gives a video without odometry its scale")
      ->check(within(0.1, 100));
  command->add_option("--rate", arguments->source.frame_rate_hz,
                      "Frames a second of numbered images; else the camera file's rate_hz, else 25");
  command->add_option("--max-width", arguments->source.max_width_px, "Wider frames are made smaller [px]")
      ->capture_default_str();
  command->add_option("--frames", arguments->frames_most, "Stop after so many frames (0: all)")->check(within(0, 1e9));
  command->add_option("--give-up", arguments->give_up_s, "Silence of a live stream that ends it [s]")
      ->capture_default_str()
      ->check(within(0.1, 86400));
  command->add_flag("--show", arguments->is_shown, "Show the overlay in a window (X11)");
  command->add_flag("!--no-video", arguments->has_video, "Write no overlay.mp4");
  command->add_flag("-q,--quiet", arguments->is_quiet, "Nothing but errors; the exit status tells how it went");
  command->footer(
      "Odometry carries the pose from frame to frame; without it the flight's own point features do.\n"
      "Writes trajectory.tum (the body in the frame of the model, frames that were followed), status.csv (a "
      "line a frame),\nfollow.json and overlay.mp4. Ctrl-C ends it and keeps what is known.\n"
      "Exit status: 0 good; 1 error; 2 unknown option; 3 not to be trusted (never placed, or followed in "
      "less than\nhalf of the frames); 130 interrupted.\n"
      "Examples:\n"
      "  bole follow monday.mp4 --model sunday.cao --camera phone.yaml -o run\n"
      "  bole follow data/park-forward --model map.cao --init 0,0,1.5,0 -o run\n"
      "  bole follow rtsp://192.168.0.20/stream --model map.cao --init click --show -o run");
  command->callback([arguments, command] {
    requireGiveUpUsed(*command, arguments->input);
    follow(*arguments);
  });
}
} // namespace bole::apps

extern "C" void boleAddCommands(CLI::App &app) { bole::apps::addFollow(app); }

extern "C" vpDisplay *boleMakeWindow(vpImage<vpRGBa> &picture, const std::string &title)
{
  return new vpDisplayX(picture, 100, 100, title);
}
