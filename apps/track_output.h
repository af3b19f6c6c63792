// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What `bole track` gathers while it runs and writes into the folder of the run.

#include "output/best_view.h"
#include "output/flight_trace.h"
#include "output/map_svg.h"
#include "output/summary_json.h"
#include "output/video_writer.h"
#include "worker.h"
#include <bole/output_folder.h>
#include <bole/pipeline.h>
#include <bole/vpArDroneGrabber.h>

#include <atomic>
#include <future>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace bole::apps
{
/// What `bole track` writes, summary.json first.
extern const FileNames kRunFiles;

class TrackOutput
{
public:
  /// Makes the folder. \p made: how the run is made, as far as that is known before it begins. \p has_pictures: whether
  /// somebody looks at what add() returns. \throw vpException when the folder cannot be made.
  /// \p is_shown_again: whether all frames come once more, to showAgain(), which then draws the overlay.
  TrackOutput(const std::string &run, RunSummary made, const FrameSource &source, bool has_video, bool has_pictures,
              bool is_shown_again);
  ~TrackOutput();

  /// Takes in a frame and returns its overlay: empty for a frame without an image, and where nobody looks at it.
  /// \p age_ms: of a live frame when \p report was there.
  vpImage<vpRGBa> add(const Frame &frame, const FrameReport &report, std::optional<double> age_ms = {});
  /// Takes in a frame of before as the final map has it: for the overlay, views/ and what the trunks were seen in.
  void showAgain(const Frame &frame, FrameReport report);
  /// Counts \p frames missing ones at the end of the flight, of which nothing is known.
  void addSilence(std::size_t frames);
  /// What came of the drone's packets.
  void setLink(const LinkCounters &link);
  /// Begins to write what is known now, in the background: all but the videos and the best views. Nothing while the
  /// last one is still being written, nor before this run knows as many frames as the one that was in the folder.
  void keep(const Pipeline &pipeline);
  /// Writes all but the videos.
  void write(const Pipeline &pipeline, bool is_complete);
  /// Ends the videos. A video that cannot be written is lost with a warning, and nothing else is.
  void finish();

  std::size_t trunksInView() const { return m_in_view; }
  bool hasTruth() const { return !m_picture.truth_trunks.empty(); }
  Verdict verdict() const { return judge(m_summary); }
  const TimingTable &timing() const { return m_summary.timing; }

private:
  void trace(const Frame &frame, const FrameReport &report);
  void traceTrunks(const Frame &frame, const FrameReport &report);
  bool hasImage(const Frame &frame) const;
  void writeBestViews() const;
  FlightTrace confirmedTrace() const;
  vpImage<vpRGBa> draw(const Frame &frame, const FrameReport &report);
  template <typename Action> void film(const Action &action);
  void loseVideos(const std::string &why);
  MapPicture take(const Pipeline &pipeline, bool is_complete);
  void waitForFilm();
  void waitForKeeping();

  OutputFolder m_folder;
  std::size_t m_frames_before = 0; ///< of the run that was in the folder
  RunSummary m_summary;
  std::vector<SensorVerdict> m_sensors_before;    ///< that were left out from the start
  MapPicture m_picture;                           ///< as far as frames tell
  FlightTrace m_trace;                            ///< without views
  std::map<int, std::vector<TrunkTrace>> m_views; ///< of each hypothesis that was not given up
  BestViews m_best_views;
  Pose m_bMc;
  bool m_has_pictures, m_is_overlay_due; ///< the overlay is drawn by the map at hand
  std::unique_ptr<VideoWriter> m_overlay, m_saliency;
  std::size_t m_in_view = 0;
  std::int64_t m_first_ns = 0, m_last_ns = 0;
  bool m_is_begun = false;
  std::atomic<bool> m_is_cancelled{false};
  std::future<std::optional<InputDigest>> m_digest;
  std::future<std::string> m_keeping; ///< what went wrong; it and the film last: they end before the rest goes
  std::future<void> m_filming;        ///< of the frame before
  Worker m_film_worker;
};
} // namespace bole::apps
