// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/trunk_record.h>

#include "geometry/names.h"

#include <fmt/format.h>

namespace bole
{
const char *toString(TrunkStatus status) { return nameOf(status, {"candidate", "confirmed", "lost", "merged"}); }

const char *toString(RejectReason reason)
{
  return nameOf(reason, {"none", "undecided", "unseen", "missed", "doubted", "outdone", "duplicate", "unranged"});
}

const char *toString(ScaleSource source) { return nameOf(source, {"odometry", "height", "prior"}); }

const char *toString(GravitySource source) { return nameOf(source, {"odometry", "trunks", "assumed"}); }

std::string describe(const WorldReference &reference)
{
  std::string scale = "odometry", up = "odometry";
  if (reference.scale == ScaleSource::height)
    scale = "height of the camera";
  else if (reference.scale == ScaleSource::prior)
    scale = "prior on the radius";
  if (reference.gravity == GravitySource::trunks)
    up = "trunks";
  else if (reference.gravity == GravitySource::assumed)
    up = "first image taken to be upright";
  if (reference.scale_sigma > 0)
    scale += fmt::format(" (+- {:.0f} %)", 100 * reference.scale_sigma);
  if (reference.gravity_sigma > 0)
    up += fmt::format(" (+- {:.1f} degrees)", reference.gravity_sigma * 180 / M_PI);
  return fmt::format("scale: {}; gravity: {}{}", scale, up,
                     reference.has_ranges ? "" : "; the camera only rotated: bearings, no ranges");
}
} // namespace bole
