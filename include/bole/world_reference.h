// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where the scale and the direction of gravity of a map come from, and how far each may be off.

#include <string>

namespace bole
{
/// Where the scale of the map comes from.
enum class ScaleSource
{
  odometry, ///< the pose filter
  height,   ///< a known height over the ground
  prior     ///< the radius a trunk usually has: distances are right only as far as that is
};
/// As summary.json writes it.
const char *toString(ScaleSource source);

/// Where the direction of gravity comes from.
enum class GravitySource
{
  odometry, ///< the pose filter
  trunks,   ///< the common vanishing point of the trunks
  assumed   ///< the first image is taken to be upright
};
/// As summary.json writes it.
const char *toString(GravitySource source);

/// Where the scale and the direction of gravity of a map come from.
struct WorldReference
{
  ScaleSource scale = ScaleSource::odometry; ///< source of the scale
  double scale_sigma = 0; ///< relative standard deviation of all lengths together, 0 where the source does not say
  GravitySource gravity = GravitySource::odometry; ///< source of the direction of gravity
  double gravity_sigma = 0;                        ///< of up [rad], 0 where the source does not say
  /// False: the camera only turned, so that trunks have a bearing and a width; their ranges are those of the prior on
  /// the radius.
  bool has_ranges = true;
};

/// "scale: prior on the radius (+- 19 %); up: trunks (+- 0.8 degrees)"; for pictures and tables.
std::string describe(const WorldReference &reference);
} // namespace bole
