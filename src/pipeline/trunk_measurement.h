// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Measurements of the trunks predicted in a frame.

#include "pipeline/prediction.h"
#include <bole/summary_factor.h>

namespace bole
{
/// A predicted trunk with its measurement in the frame.
struct TrackedTrunk
{
  PredictedTrunk predicted;
  TrackingResult result;            ///< `tracked` only inside the gate
  bool is_flipped = false;          ///< borders of the other sign stand where it was expected
  std::optional<double> continuity; ///< continuityOf() it
};

/// Whether the measurement is inside the gate: chi-square bound on the squared Mahalanobis distance of bearing and
/// log(r/d), by the covariance of the prediction and the noise of the borders.
bool isInsideGate(const TrackingPrediction &prediction, const TrackingResult &result, double fx,
                  const FlowOptions &options);

/// Mean squared innovation of both borders [px^2], at most 9. It is divided by the variance allowed to a wide trunk,
/// whose borders are rougher, and to weak borders, which noise moves.
double meanSquaredInnovation(const TrackingResult &result, const RelativeTrunk &expected, double fx,
                             const FlowOptions &options);

/// Share of its information that a view from \p camera adds to the view before, from \p before [m].
double weightOfView(const std::optional<Eigen::Vector3d> &before, const Eigen::Vector3d &camera,
                    const FlowOptions &options);

/// The summary factor of a trunk tracked (Eq. 9), of which \p weight counts.
SummaryFactor summaryOf(const TrackingResult &result, double weight);

/// The view that a tracked trunk adds to its history. \p expected: its prediction.
TrunkView viewOf(const TrackingResult &result, const RelativeTrunk &expected, const Trunk &trunk, const Viewpoint &view,
                 const FlowOptions &options);

/// Looks for each predicted trunk in the \p gradient of \p image.
std::vector<TrackedTrunk> trackTrunks(const vpImage<unsigned char> &image, const Gradient &gradient,
                                      const std::vector<PredictedTrunk> &predicted, const TrunkMap &map,
                                      const Viewpoint &view, const StageOptions &options);

/// The measurement that the map records of a tracked trunk.
TrunkMeasurement measurementOf(const TrackedTrunk &tracked, const TrunkMap &map, const Viewpoint &view,
                               const FlowOptions &options);
} // namespace bole
