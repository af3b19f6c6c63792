// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/measured_camera.h"

#include "input/live_video.h"
#include "input/recorded_source.h"
#include "motion/focal_length.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
struct FieldOfView
{
  double degrees = 0, sigma_degrees = 0; ///< horizontal; 0 where the video does not tell
};

FieldOfView fieldOfView(FrameSource &source)
{
  constexpr int kFrames = 200;
  const PinholeCamera camera = source.camera();
  PointTracker tracker(camera);
  FocalFinder focal(camera);
  Frame frame;
  for (int i = 0; i < kFrames && source.next(frame); ++i) {
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
} // namespace

MeasuredSource openMeasured(const std::string &input, const SourceOptions &options, double give_up_s)
{
  const bool is_stream = LiveVideoSource::accepts(input);
  MeasuredSource opened;
  opened.options = options;
  opened.source = is_stream ? openStream(input, options, give_up_s) : openSource(input, options);
  opened.note = opened.source->note();
  opened.is_camera_known = opened.source->isCameraKnown() || options.field_of_view_deg;
  if (opened.is_camera_known || is_stream)
    return opened;
  const FieldOfView view = fieldOfView(*openSource(input, options));
  if (view.degrees == 0)
    return opened;
  opened.options.field_of_view_deg = std::clamp(view.degrees, 10.0, 150.0);
  opened.source = openSource(input, opened.options);
  opened.is_camera_known = true;
  opened.field_of_view_sigma_deg = view.sigma_degrees;
  opened.note = fmt::format(
      "no camera file: the camera moves as one with a field of view of {:.1f} +- {:.1f} degrees (f = {:.0f} px)",
      view.degrees, view.sigma_degrees, opened.source->camera().fx);
  if (const auto *images = dynamic_cast<const SequenceSource *>(opened.source.get());
      images && !images->rateNote().empty())
    opened.note += "; " + images->rateNote();
  return opened;
}

double focalSigma(const FrameSource &source, bool is_camera_known, double field_of_view_sigma_deg)
{
  constexpr double kGiven = 0.03; // of a field of view that the user gives: a degree or two
  if (source.isCameraKnown())
    return 0;
  if (field_of_view_sigma_deg == 0)
    return is_camera_known ? kGiven : kGuessedFocalSigma;
  const PinholeCamera camera = source.camera();
  return field_of_view_sigma_deg * M_PI / 180 / std::sin(2 * std::atan(0.5 * camera.width / camera.fx));
}
} // namespace bole
