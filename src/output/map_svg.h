// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map seen from above as an SVG picture (the paper's Fig. 6).

#include "input/trajectory.h"
#include <bole/open_source.h>
#include <bole/trunk_record.h>

#include <string>
#include <vector>

namespace bole
{
/// A map to be drawn, in the world frame [m]; empty parts are left out.
struct MapPicture
{
  std::string title;
  std::string caption;             ///< under the title: where scale and gravity come from
  std::vector<TrunkRecord> trunks; ///< confirmed: filled circle to scale with its 2-sigma ellipse; candidates: outline
  Trajectory smoothed, online, odometry, truth;
  std::vector<TruthTrunk> truth_trunks;             ///< within the frame of the picture
  bool has_ranges = true;                           ///< false: only bearings and widths are known
  Eigen::Vector2d camera = Eigen::Vector2d::Zero(); ///< from which these are seen
};

/// Draws a metre as 40 px; the picture holds the trajectories and the confirmed trunks.
std::string toSvg(const MapPicture &picture);

/// Writes toSvg() atomically.
void writeMap(const std::string &path, const MapPicture &picture);
} // namespace bole
