// SPDX-License-Identifier: GPL-2.0-or-later
#include "field_of_view.h"

#include "motion/focal_length.h"

#include <cmath>

namespace bole::apps
{
FieldOfView fieldOfView(const std::string &input, const SourceOptions &options, int frames_most)
{
  const auto source = openSource(input, options);
  const PinholeCamera camera = source->camera();
  PointTracker tracker(camera);
  FocalFinder focal(camera);
  for (int i = 0; i < frames_most; ++i) {
    Frame frame;
    if (!source->next(frame))
      break;
    if (frame.status != FrameStatus::ok)
      continue;
    tracker.track(frame.image);
    focal.add(tracker);
  }
  const FocalEstimate estimate = focal.estimate();
  if (!estimate.known)
    return {};
  const double half = 0.5 * camera.width / (camera.fx * estimate.factor);
  constexpr double kDegrees = 180 / M_PI;
  return {2 * std::atan(half) * kDegrees, 2 * estimate.sigma * half / (1 + half * half) * kDegrees};
}
} // namespace bole::apps
