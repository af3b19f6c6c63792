// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a task is told of a frame: by the pipeline, or by the truth. The same seeds flown by each tell what control,
/// tracking and mapping cost.

#include "baseline/model_tracker.h"
#include "simulation/forest.h"
#include <bole/options.h>
#include <bole/report.h>

#include <functional>
#include <string>

namespace bole
{
enum class PerceptionKind
{
  truth,      ///< true poses, and of each trunk that has been in view the true cylinder; no image is looked at
  truth_map,  ///< poses from images tracked against the true cylinders, the odometry between; the map is the truth's
  visp_edges, ///< the same by ViSP's edge tracker (vpMbGenericTracker, settings of its tutorials)
  real        ///< the pipeline
};
const char *toString(PerceptionKind kind);

/// The report of the next frame as the drone sent it, whose status may become worse here. \p truth of the body at the
/// frame.
using Perception = std::function<FrameReport(Frame &frame, const Pose &truth)>;

Perception realPerception(const PinholeCamera &camera, const Pose &bMc, const Options &options);
/// \p missing: share of the trunks that the map never has, \p asked_for (ids) not among them; where it is not 0 no bark
/// has points either.
Perception truthPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, double missing,
                           const std::vector<int> &asked_for);
/// \p tracker: of the true trunks; each gets the odometry's step from its last pose as prior (setMotionPrior() or
/// setPose()).
Perception truthMapPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, TrackerKind tracker);

/// What an eye that makes no mistake knows of a wood: it keeps what has come into view.
///
/// A trunk is in view where both its borders are in the image at the height of the camera, wider than kLeastWidth_px
/// and no farther than kReach, and where nearer bark hides less than half of it. It is confirmed at once, without
/// variance, and counts its views. Rays, a grid over the image, end at bark or ground or beyond kReach.
class TrueSight
{
public:
  /// \p missing, \p asked_for: as truthPerception.
  TrueSight(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, double missing = 0,
            const std::vector<int> &asked_for = {});
  /// Fills poses, trunks, map and points of \p report. \p truth: from where it looks; \p estimate: where it believes to
  /// be, in the world of the truth; \p is_tracked: trunks in view were measured.
  void look(const Pose &truth, const Pose &estimate, bool is_tracked, FrameReport &report);

private:
  struct Known
  {
    Trunk cylinder;
    int views = 0;
    bool is_missing = false;
  };
  void cast(const Pose &wMc, FrameReport &report) const;

  PinholeCamera m_camera;
  Pose m_bMc;
  const Forest &m_forest;
  bool m_has_points_on_bark;
  std::vector<Known> m_known; ///< of the trunks of the forest, in their order
};
} // namespace bole
