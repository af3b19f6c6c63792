// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// From frames to a map of trunks and a trajectory.
///
/// Idea: predict the pose; reduce the image to its gradient; ask for saliency and relative poses; track the known
/// trunks relative to the camera and replace the image by a summary factor each; smooth; look for new trunks where
/// none is known; review the map (paper, Sections 3 to 7).
///
/// \code
/// const auto source = bole::openSource("data/park-forward");
/// bole::Pipeline pipeline(source->camera(), source->bMc());
/// bole::Frame frame;
/// while (source->next(frame)) {
///   const bole::FrameReport report = pipeline.process(frame);
///   std::cout << report.index << ": " << report.trunks.size() << " trunks in view\n";
/// }
/// pipeline.finish();
/// for (const bole::TrunkRecord &trunk : pipeline.map()) ...
/// \endcode
///
/// A Frame may be filled by hand: an image and a stamp suffice; the first frame tells whether there is odometry.
/// Memory: the window of the detector, the graph of the smoother, and for the final pass (`stages.final_pass`) frames
/// from places apart, at most 256 MB of pictures. With `map.lag` or for servoing there is no final pass and no image is
/// kept beyond the window; with `map.lag` what a frame leaves for good is its pose and a line for each hypothesis.
/// Not thread-safe; no globals.

#include <bole/graph.h>
#include <bole/options.h>
#include <bole/pose.h>
#include <bole/report.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace bole
{
struct StageOptions;

/// What the decision on a hypothesis by all frames rested on: `bole fit-odds` fits the weights of it.
struct Decision
{
  /// Of the terms: 1, how much its columns differ at its range, by how much more they do at the best range nearer or
  /// behind, whether its range is the best, and the log-odds that the frames gave it one by one.
  static constexpr std::array<const char *, 5> kNames = {"1", "own", "elsewhere", "best_at_own", "online"};
  Trunk trunk;                 ///< where it stands best [m]
  std::array<double, 5> terms; ///< as kNames
  double log_odds = 0;         ///< that it is a trunk
};

/// From frames to a map and a trajectory: the whole system behind one class.
class Pipeline
{
public:
  /// \p camera of the rectified images, at \p bMc in the body.
  /// \throw vpException for a camera that cannot be one, or naming the option that is out of its range.
  Pipeline(const PinholeCamera &camera, const Pose &bMc, const Options &options = {});
  Pipeline(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options); ///< for tests and the ablation
  ~Pipeline();
  /// Moves the flight with all that is known.
  Pipeline(Pipeline &&) noexcept;
  Pipeline &operator=(Pipeline &&) noexcept; ///< Moves the flight with all that is known.

  /// Takes in the next frame. Frames that are not ok pass without vision: their pose is predicted, as is that of one
  /// whose picture is missing or not of the camera's size.
  /// \throw vpException naming frame, stamp and value where the stamp is not later than that of the frame before, or
  /// the stamp, odometry, gyro or accelerometer tells what cannot be (NaN, no rotation, samples out of order): the
  /// pipeline is then as it was before.
  FrameReport process(const Frame &frame);
  /// Smooths the whole flight once more, everything linearised anew, and judges every hypothesis by all frames
  /// (`stages.final_pass`): trunks may come that were never confirmed in flight, and others go.
  void finish();
  /// A frame of before as it is known now: its pose and the trunks of the map in it, without candidates. A trunk is
  /// tracked where the frame, and without one of its own the two round it, gave it a view.
  /// \param index FrameReport::index
  /// \throw vpException where no frame has it
  FrameReport review(std::size_t index) const;

  /// All that was ever found, with what became of it; a trunk is what is `confirmed`. The covariances carry the common
  /// error of the scale: it moves every trunk along its line from the first pose and changes every radius in
  /// proportion, and no camera sees it.
  std::vector<TrunkRecord> map() const;
  /// Where scale and gravity direction come from, as of the last frame.
  WorldReference reference() const;
  Trajectory smoothedTrajectory() const; ///< by all frames
  Trajectory onlineTrajectory() const;   ///< each pose as it was known right after its frame
  Graph graph() const;                   ///< of the smoother
  /// On every hypothesis that was judged by all frames, after finish(); lengths as the odometry has them.
  std::vector<Decision> decisions() const;

private:
  class Rate;
  FrameReport take(const Frame &frame);

  PinholeCamera m_camera;
  std::size_t m_frames = 0;                    ///< taken so far
  std::optional<std::int64_t> m_last_stamp_ns; ///< of the last of them
  std::unique_ptr<class Engine> m_engine;
  std::unique_ptr<Rate> m_rate; ///< until it is known
};
} // namespace bole
