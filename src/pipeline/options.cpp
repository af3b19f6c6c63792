// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/options.h>

#include "geometry/require_range.h"

namespace bole
{
void FlowOptions::validate() const
{
  requireRange("flow.adopt_most", adopt_most, 1, 100);
  requireRange("flow.detect_every", detect_every, 1, 100);
  requireRange("flow.view_spacing", view_spacing, 0, 1);
  requireRange("flow.trunk_low", trunk_low, 0, 5);
  requireRange("flow.trunk_high", trunk_high, trunk_low + 0.1, 20);
  requireRange("flow.track_range", track_range, 1, 100);
  requireRange("flow.gate", gate, 1, 100);
  requireRange("flow.contrast_noise", contrast_noise, 0, 0.5);
  requireRange("flow.gate_sigma_px", gate_sigma_px, 0.1, 10);
  requireRange("flow.search_px", search_px, 0, 5);
  requireRange("flow.view_correlation", view_correlation, 0, 1);
  requireRange("flow.turned_frames", turned_frames, 0, 1000);
}

void PipelineOptions::validate() const
{
  flow.validate();
  motion.validate();
  points.validate();
  visual.validate();
  gradient.validate();
  saliency.validate();
  detection.validate();
  lines.validate();
  tracking.validate();
  smoothing.validate();
  map.validate();
}

PipelineOptions forCompressedVideo()
{
  PipelineOptions options;
  options.points.relative_pose.min_sigma_px = 0.2;
  return options;
}
} // namespace bole
