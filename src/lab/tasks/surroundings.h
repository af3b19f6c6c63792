// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// All that a task believes to stand round the drone, and what must not be done near it.

#include "tasks/obstacles.h"

namespace bole
{
struct SafetyOptions
{
  int lost_frames = 5;       ///< frames without what the task hangs on before it hovers, 1 to 100
  int sure_frames = 3;       ///< frames with it before it goes on, 1 to 100
  int patience_frames = 40;  ///< good frames without it before it looks for another, 1 to 10000
  double hull = 0.28;        ///< radius of the drone [m], 0.05 to 2
  double least_free = 0.12;  ///< between hull and what is believed to be bark [m], 0 to 2: what the drone errs
  double stopping_s = 0.5;   ///< over which what is left of a way is flown [s], 0.1 to 5: a gain of 2/s, as hold's
  double unseen_speed = 0.5; ///< into what was not seen to be free [m/s], 0.02 to 3: a bump that breaks nothing
};

/// Gathers what the frames of a flight tell.
class Surroundings
{
public:
  void see(const FrameReport &report);
  /// Trunks of the map, candidates that have \p observations views among them, and what stands upright by the points,
  /// within \p range [m] of the drone.
  std::vector<Obstacle> surfaces(const FrameReport &report, double range, int observations) const;
  /// Round \p p (world), as far as it was seen to be free [m].
  double roomAt(const Eigen::Vector2d &p) const { return m_seen.roomAt(p); }

private:
  NearPoints m_near_points;
  SeenSpace m_seen;
};

/// \p velocity [m/s, world] at \p p, cut to what the laws allow a drone that would coast to \p rest:
/// - towards a believed surface (confirmed trunks that are rather trunks than none, upright points) no faster than lets
///   the drone stop least_free before it; nothing pushes back: what is no trunk must not drive the drone into one;
/// - no faster than lets it stop where its whole width, and least_free beside it, was seen to be free, or at
///   unseen_speed.
Eigen::Vector2d safeVelocity(const Eigen::Vector2d &velocity, const Eigen::Vector2d &p, const Eigen::Vector2d &rest,
                             const std::vector<Obstacle> &surfaces, const Surroundings &around,
                             const SafetyOptions &options);
} // namespace bole
