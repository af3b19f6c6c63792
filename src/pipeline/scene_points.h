// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Triangulated points of the scene: where obstacles stand, and which hypotheses are gaps that points are seen through.

#include "motion/point_motion.h"
#include "pipeline/prediction.h"
#include <bole/report.h>

namespace bole
{
/// The points of the newest frame that have a parallax, by least squares on their rays now and some frames ago.
/// \p wMc: cameras by good frames back, the newest first.
std::vector<TriangulatedRay> triangulate(const PointTracker &tracker, const std::vector<Pose> &wMc,
                                         const PinholeCamera &camera);

/// Points inside the borders of each active trunk and just beside them, at its range or behind it.
std::vector<PointCount> countPoints(const std::vector<TriangulatedRay> &points, const TrunkMap &map,
                                    const Viewpoint &view, const StageOptions &options);
} // namespace bole
