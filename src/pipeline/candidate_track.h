// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// From a detection to a candidate of the map: tracks it through the frames of the detector's window and fits a trunk
/// to what they measure.

#include "pipeline/trunk_measurement.h"
#include "summary/square_root.h"

#include <deque>
#include <memory>

namespace bole
{
/// A frame of the detector's window.
struct WindowView
{
  std::shared_ptr<const Gradient> gradient;
  LevelProfile profile;
  std::size_t pose = 0;
  double time_s = 0;
};

/// The last frames that were taken from places apart; the newest frame stands last, wherever it was taken.
class DetectionWindow
{
public:
  /// Adds a frame. The one before is dropped where the camera had hardly moved to it, the oldest one where the window
  /// is full or its pose is marginalised.
  void push(std::shared_ptr<const Gradient> gradient, std::size_t pose, const Viewpoint &at, const Smoother &smoother,
            const StageOptions &options);
  const std::deque<WindowView> &views() const { return m_views; }
  const WindowView &newest() const { return m_views.back(); }

private:
  std::deque<WindowView> m_views; ///< oldest first
};

/// The summary factor of one view of a trunk that is not in the smoother yet.
struct TrackedView
{
  std::size_t pose = 0;
  Pose wMb;
  SummaryFactor summary;
};

/// A detection with the measurements of it in all frames of a window.
struct CandidateTrack
{
  NewTrunk trunk; ///< without its id in the smoother
  std::vector<TrackedView> views;
};

/// A place where a trunk may stand.
struct Hypothesis
{
  int id = 0; ///< in the map
  Trunk trunk;
  double online = 0;                      ///< log-odds by TrunkMap::evidence
  double points_beside = 0;               ///< MapTrunk::pointsBeside()
  Matrix5d covariance = Matrix5d::Zero(); ///< of the place, given the poses: how far its borders are looked for
};

/// Trunks that several frames of the window agree on, best first.
std::vector<Detection> detectInWindow(const DetectionWindow &window, const Smoother &smoother, const TrunkMap &map,
                                      const Viewpoint &view, const vpImage<float> *p_background,
                                      const StageOptions &options);
/// Trunks as pairs of borders in one frame.
std::vector<LineDetection> detectInFrame(const WindowView &frame, const TrunkMap &map, const Viewpoint &view,
                                         const vpImage<float> *p_background, const StageOptions &options);

/// The prior of a new trunk near \p guess.
TrunkPrior priorOf(const Trunk &guess, const SmootherOptions &options);

/// The trunk that fits \p views best from poses that are known, near \p guess: Gauss-Newton with the priors and the
/// robust loss of the smoother.
/// \p information: of the fit, inverse covariance, or nullptr.
Trunk fitTrunk(const Trunk &guess, const std::vector<TrackedView> &views, const SmootherOptions &options,
               Matrix5d *information = nullptr);

/// Tracks one hypothesis from frame to frame and keeps the measurements that have two borders within the gate.
class CandidateTracker
{
public:
  /// \p covariance: of \p guess given the poses; borders are looked for as far as it says.
  CandidateTracker(const Trunk &guess, const Matrix5d &covariance) : m_guess(guess), m_covariance(covariance) {}

  /// \p at: from where, \p id: of the trunk in the map, -1 for one that is not in it.
  void track(const Gradient &gradient, std::size_t pose, const Pose &wMb, const Viewpoint &at, const TrunkMap &map,
             int id, const StageOptions &options);
  /// The trunk fitted to the measurements, with its covariance and mean squared innovation. \p found_s: when it was
  /// detected [s].
  CandidateTrack fit(double found_s, const PinholeCamera &camera, const StageOptions &options) const;

private:
  Trunk m_guess;
  Matrix5d m_covariance;
  std::vector<TrackedView> m_views;
  std::vector<TrunkView> m_seen;
  std::vector<TrackingResult> m_results;
  std::optional<Eigen::Vector3d> m_before;
  std::optional<double> m_left_contrast, m_right_contrast;
};

/// Tracks a hypothesis through the frames of the window. \p view: of the newest frame.
CandidateTrack trackThroughWindow(const Hypothesis &hypothesis, const DetectionWindow &window, const Smoother &smoother,
                                  const TrunkMap &map, const Viewpoint &view, const StageOptions &options);
/// Tracks a detection through the frames of the window. \p view: of the newest frame.
CandidateTrack trackThroughWindow(const Detection &detection, const DetectionWindow &window, const Smoother &smoother,
                                  const TrunkMap &map, const Viewpoint &view, const StageOptions &options);

/// A detection of one frame; its range is that of the prior on the radius. None where its borders are not found again.
std::optional<CandidateTrack> trackInFrame(const LineDetection &detection, const WindowView &frame,
                                           const Smoother &smoother, const Viewpoint &view,
                                           const StageOptions &options);
} // namespace bole
