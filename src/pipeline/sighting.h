// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a frame shows of the trunks that were predicted in it.

#include "pipeline/prediction.h"
#include <bole/summary_factor.h>

namespace bole
{
/// A predicted trunk after the frame was looked at.
struct TrackedTrunk
{
  PredictedTrunk predicted;
  TrackingResult result;            ///< `tracked` only inside the gate
  bool is_flipped = false;          ///< borders of the other sign stand where it was expected
  std::optional<double> foreground; ///< mean of 1 - p(background) inside it
};

/// Whether bearing and log(r/d) are where they were expected: chi square against the covariance of the prediction and
/// the noise of the borders.
bool isInsideGate(const TrackingPrediction &prediction, const TrackingResult &result, double fx,
                  const FlowOptions &options);

/// Mean square of the borders found against those expected [px^2], at most 9. It is divided by what is allowed to a
/// wide trunk, whose borders are rougher, and to weak borders, which noise moves.
double misfit(const TrackingResult &result, const RelativeTrunk &expected, double fx, const FlowOptions &options);

/// Share of its information that a view from \p camera adds to the view before, from \p before [m].
double weightOfView(const std::optional<Eigen::Vector3d> &before, const Eigen::Vector3d &camera,
                    const FlowOptions &options);

/// The summary factor of a trunk tracked (Eq. 9), of which \p weight counts.
SummaryFactor summaryOf(const TrackingResult &result, double weight);

/// What the view of a trunk tracked adds to its history. \p expected: where the map had it.
TrunkView viewOf(const TrackingResult &result, const RelativeTrunk &expected, const Trunk &trunk, const Viewpoint &view,
                 const FlowOptions &options);

/// Looks for each predicted trunk. \p p_background: of the frame, or nullptr.
std::vector<TrackedTrunk> trackTrunks(const Gradient &gradient, const std::vector<PredictedTrunk> &predicted,
                                      const TrunkMap &map, const vpImage<float> *p_background, const Viewpoint &view,
                                      const StageOptions &options);

/// What the map is told of a trunk tracked.
Sighting sightingOf(const TrackedTrunk &tracked, const TrunkMap &map, const Viewpoint &view,
                    const FlowOptions &options);
} // namespace bole
