// SPDX-License-Identifier: GPL-2.0-or-later
#include "track_output.h"

#include "input/asl_source.h"
#include "input/truth.h"
#include "output/timing_csv.h"
#include "output/trajectory_writer.h"
#include "output/trunks_csv.h"
#include "smoothing/g2o.h"
#include <bole/overlay.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole::apps
{
namespace
{
vpImage<float> foregroundOf(const SaliencyField &saliency)
{
  vpImage<float> foreground(saliency.p_background.getHeight(), saliency.p_background.getWidth());
  for (unsigned int i = 0; i < foreground.getSize(); ++i)
    foreground.bitmap[i] = 1 - saliency.p_background.bitmap[i];
  return foreground;
}

void writeFiles(const std::string &run, const MapPicture &picture, const RunSummary &summary)
{
  writeTrajectory(run + "/trajectory.tum", picture.smoothed);
  writeTrajectory(run + "/trajectory_online.tum", picture.online);
  writeTrunks(run + "/trunks.csv", picture.trunks);
  writeMap(run + "/map.svg", picture);
  writeTiming(run + "/timing.csv", summary.timing);
  writeSummary(run + "/summary.json", summary);
}
} // namespace

TrackOutput::TrackOutput(const std::string &run, const std::string &input, const std::string &preset,
                         const FrameSource &source, const std::string &note, bool has_video)
    : m_run(run), m_camera(source.camera())
{
  std::error_code error;
  std::filesystem::create_directories(run, error);
  if (error)
    throw vpException(vpException::ioError, "%s: cannot be made: %s", run.c_str(), error.message().c_str());
  m_summary.version = BOLE_VERSION;
  m_summary.input = input;
  m_summary.preset = preset.empty() ? "default" : preset;
  m_summary.note = note;
  m_summary.camera = m_camera;
  m_summary.has_odometry = source.hasOdometry();
  m_summary.has_gyro = source.hasGyro();
  m_picture.title = source.name();
  if (AslSource::accepts(input) && std::filesystem::exists(input + "/trees.csv"))
    m_picture.truth_trunks = readTruthTrunks(input);
  if (has_video) {
    m_overlay = std::make_unique<VideoWriter>(run + "/overlay.mp4");
    m_saliency = std::make_unique<VideoWriter>(run + "/saliency.mp4");
  }
}

vpImage<vpRGBa> TrackOutput::add(const Frame &frame, const FrameReport &report, std::optional<double> age_ms)
{
  ++m_summary.frames[frame.status];
  FrameTiming timing;
  timing.index = frame.index;
  timing.stamp_ns = frame.stamp_ns;
  timing.age_ms = age_ms;
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

  Overlay overlay;
  for (const TrunkInView &trunk : report.trunks)
    overlay.trunks.push_back(
        {trunk.id, trunk.relative, trunk.distance, trunk.tan_low, trunk.tan_high, trunk.status, trunk.is_tracked});
  m_in_view = static_cast<std::size_t>(std::count_if(report.trunks.begin(), report.trunks.end(),
                                                     [](const TrunkInView &trunk) { return trunk.is_tracked; }));
  if (report.saliency)
    overlay.foreground = foregroundOf(*report.saliency);
  overlay.is_warning = frame.status != FrameStatus::ok;
  overlay.text = fmt::format("{:.1f} s  {} trunks  {}", 1e-9 * static_cast<double>(frame.stamp_ns), m_in_view,
                             overlay.is_warning ? toString(frame.status) : "");
  if (frame.image.getSize() == 0 || static_cast<int>(frame.image.getWidth()) != m_camera.width)
    return {};
  const vpImage<vpRGBa> picture = drawOverlay(frame.image, m_camera, overlay);
  if (m_overlay)
    m_overlay->write(picture, frame.stamp_ns);
  if (m_saliency && report.saliency)
    m_saliency->write(drawSaliency(frame.image, m_camera, overlay.foreground, overlay.text), frame.stamp_ns);
  return picture;
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
  figures["live_connections"] = static_cast<double>(link.connections);
  figures["live_navdata"] = static_cast<double>(link.navdata_packets);
  figures["live_navdata_refused"] = static_cast<double>(link.navdata_refused);
  figures["live_navdata_late"] = static_cast<double>(link.navdata_late);
}

void TrackOutput::take(const Pipeline &pipeline, bool is_complete)
{
  m_picture.smoothed = pipeline.smoothedTrajectory();
  m_picture.online = pipeline.onlineTrajectory();
  m_picture.trunks = pipeline.map();
  m_summary.trunks = m_picture.trunks;
  m_summary.reference = pipeline.reference();
  m_picture.caption = describe(m_summary.reference);
  m_summary.is_complete = is_complete;
  m_confirmed =
      static_cast<int>(std::count_if(m_picture.trunks.begin(), m_picture.trunks.end(),
                                     [](const TrunkRecord &trunk) { return trunk.status == TrunkStatus::confirmed; }));
}

void TrackOutput::keep(const Pipeline &pipeline)
{
  if (m_keeping.valid()) {
    if (m_keeping.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
      return;
    m_keeping.get(); // throws what went wrong
  }
  take(pipeline, false);
  m_keeping = std::async(std::launch::async, [run = m_run, picture = m_picture, summary = m_summary] {
    writeFiles(run, picture, summary);
  });
}

void TrackOutput::write(const Pipeline &pipeline, bool is_complete)
{
  if (m_keeping.valid())
    m_keeping.get();
  take(pipeline, is_complete);
  writeFiles(m_run, m_picture, m_summary);
  writeG2o(m_run + "/graph.g2o", pipeline.graph());
}

void TrackOutput::finish()
{
  if (m_overlay)
    m_overlay->finish();
  if (m_saliency)
    m_saliency->finish();
}
} // namespace bole::apps
