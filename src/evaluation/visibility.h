// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Which trunks of the truth a flight had a fair chance to map.

#include "input/trajectory.h"
#include "input/truth.h"
#include <bole/camera.h>
#include <bole/evaluation.h>

#include <vector>

namespace bole
{
/// When a trunk counts as a fair chance.
struct VisibilityOptions
{
  double max_range = 8;          ///< [m], horizontal, from the camera to the axis
  double max_hidden = 0.5;       ///< share of the trunk's width that nearer trunks may hide
  std::size_t min_frames = 8;    ///< frames in which all of this holds
  double min_bearing_change = 3; ///< [degrees], over those frames, in the world
};

/// Sees every trunk of \p trunks from the true poses \p wMb of the frames.
///
/// A trunk is inside the image when both of its borders are at the height of the camera; it is
/// hidden as far as the bearings between its borders are covered by those of nearer trunks. Trunks
/// without radius (far ones) neither hide nor are expected.
std::vector<TrunkVisibility> trunkVisibility(const std::vector<TruthTrunk> &trunks, const std::vector<Pose> &wMb,
                                             const Pose &bMc, const PinholeCamera &camera,
                                             const VisibilityOptions &options = {});
} // namespace bole
