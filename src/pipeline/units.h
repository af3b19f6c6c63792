// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Between units of length and metres. A camera without odometry maps in a unit of its own; options are taken to that
/// unit, and what a user reads is taken from it. Within the pipeline nothing is ever rescaled.

#include "pipeline/stage_options.h"
#include <bole/report.h>

namespace bole
{
/// \p options with every length in units of \p metres each.
StageOptions inUnits(StageOptions options, double metres);

/// From units of \p metres each to metres. Of a pose the path of the camera grows, with the camera at \p bMc.
Pose inMetres(const Pose &wMb, const Pose &bMc, double metres);
Trunk inMetres(const Trunk &trunk, double metres);
TrunkRecord inMetres(TrunkRecord record, double metres);
/// Trunks, map, points and poses of a report.
void toMetres(FrameReport &report, const Pose &bMc, double metres);
} // namespace bole
