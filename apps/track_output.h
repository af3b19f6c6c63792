// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The folder that `bole track` writes, every file atomically.

#include "ardrone/drone_link.h"
#include "output/map_svg.h"
#include "output/summary_json.h"
#include "output/video_writer.h"
#include <bole/pipeline.h>

#include <future>
#include <memory>
#include <string>

namespace bole::apps
{
class TrackOutput
{
public:
  /// Makes the folder. \throw vpException when that cannot be done.
  TrackOutput(const std::string &run, const std::string &input, const std::string &preset, const FrameSource &source,
              const std::string &note, bool has_video);

  /// Takes in a frame and returns its overlay (empty for a frame without an image). \p age_ms: of a live frame when
  /// \p result was there.
  vpImage<vpRGBa> add(const Frame &frame, const FrameReport &report, std::optional<double> age_ms = {});
  /// Counts \p frames missing ones at the end of the flight, of which nothing is known.
  void addSilence(std::size_t frames);
  /// What came of the drone's packets.
  void setLink(const LinkCounters &link);
  /// Begins to write what is known now, in the background: all but the videos and the graph, which
  /// takes longer than a frame. Nothing while the last one is still being written.
  void keep(const Pipeline &pipeline);
  /// Writes all but the videos.
  void write(const Pipeline &pipeline, bool is_complete);
  /// Ends the videos.
  void finish();

  std::size_t trunksInView() const { return m_in_view; }
  int confirmed() const { return m_confirmed; }
  const TimingTable &timing() const { return m_summary.timing; }

private:
  void take(const Pipeline &pipeline, bool is_complete);

  std::string m_run;
  RunSummary m_summary;
  PinholeCamera m_camera;
  MapPicture m_picture;
  std::unique_ptr<VideoWriter> m_overlay, m_saliency;
  std::size_t m_in_view = 0;
  int m_confirmed = 0;
  std::future<void> m_keeping; ///< last: it ends before the rest goes
};
} // namespace bole::apps
