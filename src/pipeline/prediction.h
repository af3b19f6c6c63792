// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a camera should see of the map: where each trunk stands, which part of it, and what hides it.

#include "detection/detector.h"
#include "map/trunk_map.h"
#include "pipeline/ground.h"
#include "pipeline/stage_options.h"
#include "tracking/trunk_tracker.h"

#include <optional>
#include <vector>

namespace bole
{
/// Where no range is known: what trunks fill that stand far away too, and whatever the pitch is wrong by.
constexpr ElevationRange kUnrangedPart = {-0.06, 0.2};

/// From where a frame looks at the map, and what is known of the world there.
struct Viewpoint
{
  PinholeCamera camera;
  Pose wMc;
  bool has_ranges = true;            ///< false while the camera has only rotated
  std::optional<GroundPlane> ground; ///< in the world
  double time_s = 0;
};

/// A known trunk as it should appear.
struct PredictedTrunk
{
  int id = 0;
  std::size_t smoother_id = 0;
  double range = 0; ///< [m]
  TrackingPrediction tracking;
  double missed_variance = 0; ///< part of the variance of the bearing that is there for the misses before [rad^2]
  bool is_placed = true;      ///< within three standard deviations of its bearing there is room for its borders alone
};

struct HiddenBorders
{
  bool left = false, right = false;
};

/// Whether a border of \p trunk stands behind a nearer confirmed trunk of the map. \p id: of \p trunk in the map, -1
/// for one that is not in it.
HiddenBorders hiddenBorders(const Trunk &trunk, int id, const TrunkMap &map, const Viewpoint &view);

/// The part of a trunk that is looked at: between two heights over the ground, where the ground is known.
ElevationRange elevationOf(const RelativeTrunk &relative, const Trunk &trunk, const Viewpoint &view,
                           const StageOptions &options);
/// The same, up to where the detector looks: more rows tell more of what goes on across a border.
ElevationRange textureRange(const RelativeTrunk &relative, const Trunk &trunk, const Viewpoint &view,
                            const StageOptions &options);

/// Active trunks before the camera and within the range of tracking.
std::vector<PredictedTrunk> predictTrunks(const TrunkMap &map, const Smoother &smoother, const Viewpoint &view,
                                          const StageOptions &options);

/// Places in the image where the detectors need not look: those of confirmed trunks and, if \p by_candidates, of
/// candidates. The detector that asks a window of frames may come to a better hypothesis for a candidate's lines; the
/// one that asks one frame (Eq. 21) may not.
std::vector<InhibitedRange> inhibitedRanges(const TrunkMap &map, const Viewpoint &view, bool by_candidates);
} // namespace bole
