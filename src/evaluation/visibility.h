// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Which trunks of the truth a flight had a fair chance to map.

#include "input/trajectory.h"
#include <bole/camera.h>
#include <bole/evaluation.h>
#include <bole/open_source.h>

#include <vector>

namespace bole
{
/// What a fair chance is: a trunk stands within 8 m of the camera, at most half of its width is hidden by nearer
/// trunks, in 8 frames or more over which its bearing changes by 3 degrees or more.
///
/// Sees every trunk of \p trunks from the true poses \p wMb of the frames.
///
/// A trunk is inside the image when both of its borders are at the height of the camera; it is
/// hidden as far as the bearings between its borders are covered by those of nearer trunks. Trunks
/// without radius (far ones) neither hide nor are expected.
std::vector<TrunkVisibility> trunkVisibility(const std::vector<TruthTrunk> &trunks, const std::vector<Pose> &wMb,
                                             const Pose &bMc, const PinholeCamera &camera);
} // namespace bole
