// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/measured_camera.h"

#include "geometry/constants.h"
#include "input/live_video.h"
#include "input/recorded_source.h"
#include "motion/camera_gyro.h"
#include "motion/focal_length.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
struct MeasuredLens
{
  FocalEstimate focal;      ///< beside the focal length that the camera is taken to have
  std::optional<double> k1; ///< radial distortion beside that taken out
};

MeasuredLens measureLens(FrameSource &source)
{
  constexpr int kFrames = 200, kApart = 8; // of a pair of frames; every other one shares half of its time
  const PinholeCamera camera = source.camera();
  PointTracker tracker(camera);
  FocalFinder focal(camera);
  std::vector<std::vector<PointMatch>> pairs;
  Frame frame;
  for (int i = 0; i < kFrames && source.next(frame); ++i) {
    if (frame.status != FrameStatus::ok)
      continue;
    tracker.track(frame.image);
    focal.add(tracker);
    if (i >= kApart && i % (kApart / 2) == 0)
      pairs.push_back(tracker.matches(kApart));
  }
  return {focal.estimate(), calibration::findDistortion(pairs, camera, false)};
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
  constexpr int kRounds = 3;       // a lens that bends its images hides the field of view, and this the distortion
  constexpr double kFolds = -0.14; // k1 over the squared tangent at the side of the image: less has no picture there
  const PinholeCamera guess = opened.source->camera();
  double side = 0.5 * guess.width / guess.fx; // tangent of half of the field of view
  double &k1 = opened.options.distortion_k1;
  FocalEstimate focal;
  for (int round = 0; round < kRounds; ++round) {
    const MeasuredLens lens = measureLens(*opened.source);
    focal = lens.k1 || !lens.focal.known ? FocalEstimate() : lens.focal; // that of bent images is none
    side /= focal.factor;
    k1 = std::max((k1 + lens.k1.value_or(0)) * focal.factor * focal.factor, kFolds / (side * side)); // of the same px
    if (focal.known)
      opened.options.field_of_view_deg = std::clamp(2 * std::atan(side) / kDegree, 10.0, 150.0);
    opened.source = openSource(input, opened.options);
    if (!lens.k1)
      break;
  }
  opened.note = opened.source->note();
  opened.is_camera_known = focal.known;
  if (focal.known) {
    opened.field_of_view_sigma_deg = 2 * focal.sigma * side / (1 + side * side) / kDegree;
    opened.note = fmt::format(
        "no camera file: the camera moves as one with a field of view of {:.1f} +- {:.1f} degrees (f = {:.0f} px)",
        *opened.options.field_of_view_deg, opened.field_of_view_sigma_deg, opened.source->camera().fx);
  }
  if (k1 != 0)
    opened.note += fmt::format("; its lens bends the images by k1 = {:+.2f}", k1);
  if (const auto *images = dynamic_cast<const SequenceSource *>(opened.source.get());
      opened.is_camera_known && images && !images->rateNote().empty())
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
