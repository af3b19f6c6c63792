// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The folder that `bole track` writes, every file atomically.

#include <bole/output/map_svg.h>
#include <bole/output/summary_json.h>
#include <bole/output/video_writer.h>
#include <bole/pipeline/pipeline.h>

#include <memory>
#include <string>

namespace bole::apps
{
class TrackOutput
{
public:
  /// Makes the folder. \throw vpException when that cannot be done.
  TrackOutput(const std::string &run, const std::string &input, const std::string &preset, const FrameSource &source,
              bool has_video);

  /// Takes in a frame and returns its overlay (empty for a frame without an image).
  vpImage<vpRGBa> add(const Frame &frame, const FrameResult &result);
  /// Writes all but the videos, as known now.
  void write(const Pipeline &pipeline, bool is_complete);
  /// Ends the videos.
  void finish();

  std::size_t trunksInView() const { return m_in_view; }
  int confirmed() const { return m_confirmed; }
  double medianTotal_ms() const { return m_summary.timing.medianTotal_ms(); }

private:
  std::string m_run;
  RunSummary m_summary;
  PinholeCamera m_camera;
  MapPicture m_picture;
  std::unique_ptr<VideoWriter> m_overlay, m_saliency;
  std::size_t m_in_view = 0;
  int m_confirmed = 0;
};
} // namespace bole::apps
