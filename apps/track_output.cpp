// SPDX-License-Identifier: GPL-2.0-or-later
#include "track_output.h"

#include "geometry/so3.h"
#include "input/atomic_file.h"
#include "input/recorded_source.h"
#include "input/trajectory.h"
#include "output/trunks_csv.h"
#include <bole/graph.h>
#include <bole/open_source.h>
#include <bole/overlay.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fmt/format.h>
#include <iterator>
#include <malloc.h>
#include <nlohmann/json.hpp>
#include <visp3/core/vpException.h>

namespace bole::apps
{
const FileNames kRunFiles = {
    "summary.json", "trajectory.tum", "trajectory_online.tum", "trunks.csv",  "hypotheses.csv", "bearings.csv",
    "map.svg",      "timing.csv",     "options.yaml",          "graph.g2o",   "frames.csv",     "views.csv",
    "evidence.csv", "overlay.mp4",    "saliency.mp4",          "views/*.jpg", "report.html"};

namespace
{
/// Trajectories, trunks, hypotheses, map, timing, options and summary. Where no range is known (summary.reference)
/// trunks.csv has no rows, and bearings.csv holds what the camera saw.
void writeFiles(const OutputFolder &folder, const MapPicture &picture, const RunSummary &summary)
{
  writeTrajectory(folder.file("trajectory.tum"), picture.smoothed);
  writeTrajectory(folder.file("trajectory_online.tum"), picture.online);
  const bool has_ranges = summary.reference.has_ranges;
  writeTrunks(folder.file("trunks.csv"), has_ranges ? summary.trunks : std::vector<TrunkRecord>());
  writeHypotheses(folder.file("hypotheses.csv"), has_ranges ? summary.trunks : std::vector<TrunkRecord>());
  if (has_ranges)
    removeFiles(folder.path(), {"bearings.csv"});
  else
    writeBearings(folder.file("bearings.csv"), summary.trunks, picture.camera);
  writeMap(folder.file("map.svg"), picture);
  writeTiming(folder.file("timing.csv"), summary.timing);
  writeAtomically(folder.file("options.yaml"), summary.options);
  writeSummary(folder.file("summary.json"), summary);
}

vpImage<float> foregroundOf(const SaliencyField &saliency)
{
  vpImage<float> foreground(saliency.p_background.getHeight(), saliency.p_background.getWidth());
  for (unsigned int i = 0; i < foreground.getSize(); ++i)
    foreground.bitmap[i] = 1 - saliency.p_background.bitmap[i];
  return foreground;
}

/// Of the run whose summary is \p path.
std::size_t framesOf(const std::string &path)
{
  try {
    return readSummary(path).at("frames").at("all");
  }
  catch (const std::exception &) { // none yet
    return 0;
  }
}

/// Path, extent and rotation of \p trajectory.
void measureMotion(const Trajectory &trajectory, RunSummary &summary)
{
  summary.path_m = summary.extent_m = summary.rotated_deg = 0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const Pose &first = trajectory.front().wMb, &now = trajectory[i].wMb;
    summary.path_m += (now.t - trajectory[i - 1].wMb.t).norm();
    summary.extent_m = std::max(summary.extent_m, (now.t - first.t).norm());
    summary.rotated_deg = std::max(summary.rotated_deg, logSo3(first.R.transpose() * now.R).norm() * 180 / M_PI);
  }
}

/// Orders \p views by frame and leaves one a trunk and frame: as it was known in flight, or else as the final map has
/// it.
void order(std::vector<TrunkTrace> &views)
{
  const auto place = [](const TrunkTrace &view) { return std::pair(view.frame, view.id); };
  std::stable_sort(views.begin(), views.end(),
                   [&](const TrunkTrace &a, const TrunkTrace &b) { return place(a) < place(b); });
  views.erase(std::unique(views.begin(), views.end(),
                          [&](const TrunkTrace &a, const TrunkTrace &b) { return place(a) == place(b); }),
              views.end());
}

std::size_t confirmedIn(const FrameReport &report)
{
  return static_cast<std::size_t>(
      std::count_if(report.trunks.begin(), report.trunks.end(), [](const TrunkInView &trunk) {
        return trunk.is_tracked && trunk.status == TrunkStatus::confirmed;
      }));
}
} // namespace

TrackOutput::TrackOutput(const std::string &run, RunSummary made, const FrameSource &source, bool has_video,
                         bool has_pictures, bool is_shown_again)
    : m_folder(run, kRunFiles),
      m_summary(std::move(made)),
      m_bMc(source.bMc()),
      m_has_pictures(has_pictures),
      m_is_overlay_due(!is_shown_again)
{
  m_sensors_before = m_summary.sensors;
  if (!m_folder.isNew())
    m_frames_before = framesOf(m_folder.file("summary.json"));
  m_summary.camera = source.camera();
  m_summary.has_odometry = source.hasOdometry();
  m_summary.has_gyro = source.hasGyro();
  m_picture.title = source.name();
  const std::string &input = m_summary.input;
  if (AslSource::accepts(input) && std::filesystem::exists(input + "/trees.csv"))
    m_picture.truth_trunks = readTruthTrunks(input);
  if (m_folder.isNew()) { // by which the folder is known as that of a run, and the run can be made again
    m_summary.is_complete = m_summary.has_ended = false;
    writeSummary(m_folder.file("summary.json"), m_summary);
  }
  m_digest = std::async(std::launch::async, [this] { return digestOf(m_summary.input, m_is_cancelled); });
  if (has_video)
    film([this] {
      m_overlay = std::make_unique<VideoWriter>(m_folder.file("overlay.mp4"));
      m_saliency = std::make_unique<VideoWriter>(m_folder.file("saliency.mp4"));
    });
}

TrackOutput::~TrackOutput() { m_is_cancelled = true; }

vpImage<vpRGBa> TrackOutput::add(const Frame &frame, const FrameReport &report, std::optional<double> age_ms)
{
  ++m_summary.frames[report.frame_status];
  if (report.frame_status != FrameStatus::ok && !report.reason.empty())
    m_summary.reasons.emplace(report.frame_status, report.reason);
  if (report.gap_s > 0)
    m_summary.gaps.push_back({1e-9 * static_cast<double>(report.stamp_ns) - report.gap_s, report.gap_s});
  m_summary.sensors = m_sensors_before;
  m_summary.sensors.insert(m_summary.sensors.end(), report.verdicts.begin(), report.verdicts.end());
  m_first_ns = m_is_begun ? m_first_ns : frame.stamp_ns;
  m_is_begun = true;
  m_last_ns = frame.stamp_ns;
  FrameTiming timing;
  timing.index = frame.index;
  timing.stamp_ns = frame.stamp_ns;
  timing.age_ms = age_ms;
  timing.stages_ms.reserve(report.timing_ms.size());
  for (const auto &[stage, ms] : report.timing_ms) {
    if (timing.stages_ms.size() >= m_summary.timing.stages.size())
      m_summary.timing.stages.emplace_back(stage);
    timing.stages_ms.push_back(ms);
    timing.total_ms += ms;
  }
  m_summary.timing.frames.push_back(timing);
  if (frame.wMb_odometry)
    m_picture.odometry.push_back({frame.stamp_ns, *frame.wMb_odometry});
  if (frame.wMb_truth)
    m_picture.truth.push_back({frame.stamp_ns, *frame.wMb_truth});
  m_in_view = confirmedIn(report);
  trace(frame, report);
  waitForFilm();
  return hasImage(frame) && (m_overlay || m_has_pictures) ? draw(frame, report) : vpImage<vpRGBa>();
}

void TrackOutput::showAgain(const Frame &frame, FrameReport report)
{
  if (report.index == 0)
    m_best_views = {}; // between the borders of the final map
  report.frame_status = m_trace.frames[report.index].status;
  m_is_overlay_due = true;
  m_in_view = confirmedIn(report);
  traceTrunks(frame, report);
  waitForFilm();
  if (hasImage(frame) && m_overlay)
    draw(frame, report);
}

bool TrackOutput::hasImage(const Frame &frame) const
{
  return static_cast<int>(frame.image.getWidth()) == m_summary.camera.width &&
         static_cast<int>(frame.image.getHeight()) == m_summary.camera.height;
}

void TrackOutput::trace(const Frame &frame, const FrameReport &report)
{
  constexpr double kFar = 15; // points beyond are no evidence of a trunk of the map [m]
  const Eigen::Matrix3d wRb = report.wMb.R;
  const Eigen::Matrix3d place_covariance = wRb * report.pose_covariance.topLeftCorner<3, 3>() * wRb.transpose();
  m_trace.frames.push_back({frame.index, frame.stamp_ns, report.frame_status, report.wMb.t,
                            place_covariance.topLeftCorner<2, 2>(), report.reason});
  for (const Eigen::Vector3d &point : placedPoints(report, kFar))
    m_trace.evidence.add(point);
  for (const int id : report.given_up) {
    m_best_views.forget(id);
    m_views.erase(id);
  }
  traceTrunks(frame, report);
}

void TrackOutput::traceTrunks(const Frame &frame, const FrameReport &report)
{
  for (const TrunkInView &view : report.trunks) {
    const KnownTrunk *known = knownTrunk(report, view.id);
    if (!view.is_tracked || known == nullptr)
      continue;
    const double radius = known->trunk.radius(), relative_sigma = std::sqrt(std::max(0.0, known->log_radius_variance));
    const Eigen::Vector2d line = known->trunk.xy - report.wMc.t.head<2>(), along = line.normalized();
    const double across = line.norm() * std::sqrt(std::max(0.0, known->bearing_variance));
    const Eigen::Array2d variance = along.array().square() * std::pow(line.norm() * relative_sigma, 2) +
                                    along.reverse().array().square() * across * across;
    m_views[view.id].push_back({frame.index, frame.stamp_ns, view.id, view.distance, view.distance * relative_sigma,
                                radius, radius * relative_sigma, known->trunk.xy, variance.sqrt()});
    if (view.relative.isFinite() && hasImage(frame))
      m_best_views.add(view.id, frame.image, m_summary.camera, view.relative, view.tan_low, view.tan_high);
  }
}

/// views/ID.jpg of each trunk.
void TrackOutput::writeBestViews() const
{
  const std::string folder = m_folder.file("views");
  removeFiles(m_folder.path(), {"views/*.jpg"}); // of an earlier run
  std::filesystem::create_directories(folder);
  for (const TrunkRecord &trunk : m_summary.trunks)
    if (trunk.status == TrunkStatus::confirmed)
      if (const std::string jpeg = m_best_views.jpeg(trunk.id); !jpeg.empty())
        writeAtomically(fmt::format("{}/{}.jpg", folder, trunk.id), jpeg);
}

vpImage<vpRGBa> TrackOutput::draw(const Frame &frame, const FrameReport &report)
{
  Overlay overlay;
  std::size_t candidates = 0;
  overlay.trunks = report.trunks;
  for (const TrunkInView &trunk : report.trunks)
    candidates += trunk.is_tracked && trunk.status == TrunkStatus::candidate ? 1 : 0;
  overlay.is_warning = report.frame_status != FrameStatus::ok;
  overlay.text = fmt::format("{:.1f} s  {} trunk{}, {} candidate{}  {}", 1e-9 * static_cast<double>(frame.stamp_ns),
                             m_in_view, m_in_view == 1 ? "" : "s", candidates, candidates == 1 ? "" : "s",
                             overlay.is_warning ? toString(report.frame_status) : "");
  if (report.saliency)
    overlay.foreground = foregroundOf(*report.saliency);
  vpImage<vpRGBa> picture;
  if (m_has_pictures)
    picture = drawOverlay(frame.image, m_summary.camera, overlay);
  m_filming = m_film_worker([this, image = frame.image, stamp_ns = frame.stamp_ns, picture, overlay] {
    film([&] {
      if (m_overlay && m_is_overlay_due)
        m_overlay->write(m_has_pictures ? picture : drawOverlay(image, m_summary.camera, overlay), stamp_ns);
      if (m_saliency && overlay.foreground.getSize() > 0)
        m_saliency->write(drawSaliency(image, m_summary.camera, overlay.foreground, overlay.text), stamp_ns);
    });
  });
  return picture;
}

/// The videos are drawn and encoded while the next frame is worked on.
void TrackOutput::waitForFilm()
{
  if (m_filming.valid())
    m_filming.get();
}

/// A video that cannot be written, on a full disk for example, costs nothing else.
template <typename Action> void TrackOutput::film(const Action &action)
{
  try {
    action();
  }
  catch (const vpException &error) {
    loseVideos(error.what());
  }
}

void TrackOutput::loseVideos(const std::string &why)
{
  if (m_overlay || m_saliency)
    fmt::print(stderr, "bole: {}; the run goes on without videos\n", why);
  m_overlay.reset(); // their unfinished files go, which may make room for the rest
  m_saliency.reset();
}

void TrackOutput::addSilence(std::size_t frames)
{
  if (frames == 0)
    return;
  m_summary.frames[FrameStatus::missing] += frames;
  m_summary.figures["missing_after_the_last_image"] = static_cast<double>(frames);
}

void TrackOutput::setLink(const LinkCounters &link)
{
  auto &figures = m_summary.figures;
  figures["live_frames_dropped"] = static_cast<double>(link.dropped + link.video.skipped);
  figures["live_video_refused"] = static_cast<double>(link.video.refused);
  figures["live_connections"] = static_cast<double>(link.connections);
  figures["live_navdata"] = static_cast<double>(link.navdata_packets);
  figures["live_navdata_refused"] = static_cast<double>(link.navdata_refused);
  figures["live_navdata_late"] = static_cast<double>(link.navdata_late);
}

/// What is known now: the picture, with m_summary up to date.
MapPicture TrackOutput::take(const Pipeline &pipeline, bool is_complete)
{
  MapPicture picture = m_picture;
  picture.smoothed = pipeline.smoothedTrajectory();
  picture.online = pipeline.onlineTrajectory();
  picture.trunks = pipeline.map();
  m_summary.trunks = picture.trunks;
  m_summary.reference = pipeline.reference();
  picture.caption = describe(m_summary.reference);
  picture.has_ranges = m_summary.reference.has_ranges;
  m_summary.is_complete = is_complete;
  m_summary.duration_s = 1e-9 * static_cast<double>(m_last_ns - m_first_ns);
  measureMotion(picture.smoothed, m_summary);
  if (!picture.smoothed.empty()) {
    m_summary.first_place = picture.smoothed.front().wMb.t.head<2>();
    picture.camera = (picture.smoothed.front().wMb * m_bMc).t.head<2>();
  }
  return picture;
}

void TrackOutput::waitForKeeping()
{
  if (!m_keeping.valid())
    return;
  const std::string error = m_keeping.get();
  waitForFilm();
  if (!error.empty())
    loseVideos(error); // the disk may be full of them
}

/// With the views of confirmed trunks alone, and without lengths where none is known.
FlightTrace TrackOutput::confirmedTrace() const
{
  FlightTrace trace;
  trace.frames = m_trace.frames;
  if (!m_summary.reference.has_ranges)
    return trace;
  trace.evidence = m_trace.evidence;
  for (const TrunkRecord &trunk : m_summary.trunks)
    if (const auto seen = m_views.find(trunk.id); trunk.status == TrunkStatus::confirmed && seen != m_views.end())
      trace.views.insert(trace.views.end(), seen->second.begin(), seen->second.end());
  return trace;
}

void TrackOutput::keep(const Pipeline &pipeline)
{
  if (m_trace.frames.size() < m_frames_before)
    return;
  if (m_keeping.valid() && m_keeping.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return;
  waitForKeeping();
  struct Known
  {
    MapPicture picture;
    RunSummary summary;
    FlightTrace trace;
    Graph graph;
  };
  m_summary.has_ended = false;
  auto known = std::make_unique<Known>();
  known->picture = take(pipeline, false);
  known->summary = m_summary;
  known->trace = confirmedTrace();
  known->graph = pipeline.graph();
  m_keeping = std::async(std::launch::async, [this, known = std::move(known)]() mutable -> std::string {
    try {
      order(known->trace.views);
      writeTrace(m_folder.path(), known->trace);
      writeG2o(m_folder.file("graph.g2o"), known->graph);
      writeFiles(m_folder, known->picture, known->summary);
    }
    catch (const std::exception &error) {
      return error.what();
    }
    known.reset();
    malloc_trim(0); // a long flight has megabytes of it, which the system would get back at its end
    return {};
  });
}

void TrackOutput::write(const Pipeline &pipeline, bool is_complete)
{
  waitForFilm();
  waitForKeeping();
  m_is_cancelled = !is_complete;
  if (m_digest.valid())
    m_summary.digest = m_digest.get();
  const MapPicture picture = take(pipeline, is_complete);
  m_summary.has_ended = true;
  try {
    writeFiles(m_folder, picture, m_summary);
  }
  catch (const vpException &error) {
    loseVideos(error.what());
    writeFiles(m_folder, picture, m_summary);
  }
  writeG2o(m_folder.file("graph.g2o"), pipeline.graph());
  FlightTrace trace = confirmedTrace();
  order(trace.views);
  writeTrace(m_folder.path(), trace);
  writeBestViews();
}

void TrackOutput::finish()
{
  film([this] {
    if (m_overlay)
      m_overlay->finish();
    if (m_saliency)
      m_saliency->finish();
  });
}
} // namespace bole::apps
