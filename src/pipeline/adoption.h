// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// From a detection to a candidate of the map: what the frames at hand show of it.

#include "pipeline/sighting.h"
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

/// The last frames from places apart; the newest stands last, wherever it is.
class DetectionWindow
{
public:
  /// The view before gives way where the camera had hardly moved to it; the oldest where the window is full or its
  /// pose is marginalised.
  void push(std::shared_ptr<const Gradient> gradient, std::size_t pose, const Viewpoint &at, const Smoother &smoother,
            const StageOptions &options);
  const std::deque<WindowView> &views() const { return m_views; }
  const WindowView &newest() const { return m_views.back(); }

private:
  std::deque<WindowView> m_views; ///< oldest first
};

/// A summary of one view of a trunk that is about to be added.
struct AdoptedView
{
  std::size_t pose = 0;
  Pose wMb;
  SummaryFactor summary;
};

/// A detection with what was seen of it.
struct Adoption
{
  NewTrunk trunk; ///< without its id in the smoother
  std::vector<AdoptedView> views;
};

/// A place where a trunk may stand.
struct Hypothesis
{
  int id = 0; ///< in the map
  Trunk trunk;
  double online = 0;                      ///< log-odds by TrunkMap::evidence
  Matrix5d covariance = Matrix5d::Zero(); ///< of the place, given the poses: how far its borders are looked for
};

/// What stands in several frames of the window where one trunk would, best first.
std::vector<Detection> detectInWindow(const DetectionWindow &window, const Smoother &smoother, const TrunkMap &map,
                                      const Viewpoint &view, const vpImage<float> *p_background,
                                      const StageOptions &options);
/// Pairs of borders in one frame.
std::vector<LineDetection> detectInFrame(const WindowView &frame, const TrunkMap &map, const Viewpoint &view,
                                         const vpImage<float> *p_background, const StageOptions &options);

/// The prior of a new trunk near \p guess.
TrunkPrior priorOf(const Trunk &guess, const SmootherOptions &options);

/// The trunk that fits \p views best from poses that are known, near \p guess: Gauss-Newton with the priors and the
/// robust loss of the smoother.
/// \p information: of the fit, inverse covariance, or nullptr.
Trunk fitTrunk(const Trunk &guess, const std::vector<AdoptedView> &views, const SmootherOptions &options,
               Matrix5d *information = nullptr);

/// Looks for one trunk in frame after frame and keeps what it finds: two borders within the gate.
class Follower
{
public:
  /// \p covariance: of \p guess given the poses; borders are looked for as far as it says.
  Follower(const Trunk &guess, const Matrix5d &covariance) : m_guess(guess), m_covariance(covariance) {}

  /// \p at: from where, \p id: of the trunk in the map, -1 for one that is not in it.
  void look(const Gradient &gradient, std::size_t pose, const Pose &wMb, const Viewpoint &at, const TrunkMap &map,
            int id, const StageOptions &options);
  /// The trunk fitted to what was found, with how well it fits. \p found_s: when it was found.
  Adoption fitted(double found_s, const PinholeCamera &camera, const StageOptions &options) const;

private:
  Trunk m_guess;
  Matrix5d m_covariance;
  std::vector<AdoptedView> m_views;
  std::vector<TrunkView> m_seen;
  std::vector<TrackingResult> m_results;
  std::optional<Eigen::Vector3d> m_before;
  std::optional<double> m_left_contrast, m_right_contrast;
};

/// What the views of the window show of a hypothesis. \p view: of the newest frame.
Adoption followThroughWindow(const Hypothesis &hypothesis, const DetectionWindow &window, const Smoother &smoother,
                             const TrunkMap &map, const Viewpoint &view, const StageOptions &options);
/// A detection of the window, followed through its views. \p view: of the newest frame.
Adoption followThroughWindow(const Detection &detection, const DetectionWindow &window, const Smoother &smoother,
                             const TrunkMap &map, const Viewpoint &view, const StageOptions &options);

/// A detection of one frame; its range is that of the prior on the radius. None where its borders are not found again.
std::optional<Adoption> followInFrame(const LineDetection &detection, const WindowView &frame, const Smoother &smoother,
                                      const Viewpoint &view, const StageOptions &options);
} // namespace bole
