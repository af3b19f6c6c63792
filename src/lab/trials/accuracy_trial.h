// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One simulated flight, tracked and evaluated in memory: what `bole simulate`, `track` and `evaluate` do by files.

#include "evaluation/trajectory_metrics.h"
#include "evaluation/trunk_metrics.h"
#include "lab/simulation/simulated_flight.h"
#include "pipeline/stage_options.h"
#include <bole/pipeline.h>

#include <functional>

namespace bole
{
struct AccuracyTrialResult
{
  TrunkMetrics trunks;
  TrajectoryErrors trajectory, odometry;               ///< after Alignment::xy_yaw: smoothed, and the pose filter's
  TrajectoryErrors trajectory_scaled, odometry_scaled; ///< after Alignment::xy_yaw_scale
  double median_ms = kNotMeasured;                     ///< of a frame in the pipeline
};

/// Renders \p frames of \p scene, tracks them with \p options and compares map and trajectory with the truth.
/// \p is_cancelled is asked before each frame.
AccuracyTrialResult runAccuracyTrial(const SceneOptions &scene, int frames, const Options &options,
                                     const std::function<bool()> &is_cancelled = {});

/// The trunks of \p forest as ground truth: at breast height.
std::vector<TruthTrunk> truthOf(const Forest &forest);
} // namespace bole
