// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/stage_options.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
/// What a corner is believed to at best in pictures that went through a lossy codec: where it leaves blocks standing,
/// corners stand too, an error that many share and that their residuals do not show.
constexpr double kCompressedSigma_px = 0.2;

/// What the thresholds on the picture are held for.
constexpr double kFocal_px = 200;

int oddNear(double value, int most) { return std::min(2 * static_cast<int>(std::lround((value - 1) / 2)) + 1, most); }

/// Thresholds on the picture for a camera whose focal length is \p s times 200 px.
void scaleToCamera(StageOptions &o, double s)
{
  /// Half of a border's error is the roughness of the bark, an angle; half is blur and noise of the picture, in pixels.
  const double place = (1 + s) / 2;
  /// A narrow view shows a border softer: the bark's edge is wider than a pixel.
  const double blur = std::sqrt(std::max(s, 1.0));
  o.gradient.sigma_px *= blur;
  o.detection.profile.contrast_min /= blur;
  o.tracking.contrast_min /= blur;
  o.lines.border_a *= blur;
  o.flow.gate_sigma_px *= place;
  o.flow.search_px *= place;
  o.detection.inlier_px *= place;
  o.detection.rms_max_px *= place;
  o.tracking.scan_min_px *= place;
  o.tracking.scan_max_px *= place;
  o.tracking.polish_max_px *= place;
  o.map.innovation_unit_px *= place;
  o.lines.width_min_px *= s;
  o.lines.width_max_px *= s;
  o.lines.inhibition_px *= s;
  /// Saliency asks for parts of a trunk, an angle: a picture as fine as twice the usual, or nearly, is halved once
  /// more.
  constexpr double kNearly = 1.1;
  const int halved = static_cast<int>(std::floor(std::log2(std::max(kNearly * s, 1.0))));
  o.saliency.finest_level += halved;
  o.saliency.levels += halved;
  o.saliency.window_width_px = oddNear(std::ldexp(o.saliency.window_width_px * s, -halved), 31);
  o.saliency.window_height_px = oddNear(std::ldexp(o.saliency.window_height_px * s, -halved), 31);
}

double rateOf(const Options &options) { return options.camera.rate > 0 ? options.camera.rate : Options::kUsualRate_hz; }

/// What is counted in frames, for \p k times 10 frames a second.
void scaleToRate(StageOptions &o, double k)
{
  o.points.every = std::max(1, static_cast<int>(std::ceil(k - 0.5)));
  const int times = static_cast<int>(3 * k / o.points.every + 0.01);
  o.points.frames_back = {o.points.every, std::max(2, times) * o.points.every};
  o.saliency.max_frames_apart = std::clamp(static_cast<int>(std::lround(o.saliency.max_frames_apart * k)), 1, 20);
}

void setTrunks(StageOptions &o, const Options::Trunks &trunks)
{
  o.smoothing.prior_radius = o.map.usual_radius = trunks.radius;
  o.smoothing.prior_log_radius_sigma = trunks.radius_sigma;
  o.smoothing.prior_lean_sigma = o.map.lean_sigma = trunks.lean;
  o.detection.radius_min = trunks.radius_min;
  o.detection.radius_max = trunks.radius_max;
  /// A trunk that was found may prove thinner or thicker by these factors than what is looked for.
  constexpr double kThinner = 1.2, kThicker = 1.58;
  o.map.radius_min = trunks.radius_min / kThinner;
  o.map.radius_max = trunks.radius_max * kThicker;
  o.flow.trunk_low = trunks.low;
  o.flow.trunk_high = trunks.high;
}

void setRange(StageOptions &o, const Options::Range &range)
{
  o.flow.track_range = range.track;
  o.detection.range_min = range.detect_min;
  o.detection.range_max = range.detect_max;
  constexpr double kParallax = 0.04; // rad: least that two views of the window differ by at the nearest trunk
  o.flow.view_spacing = kParallax * range.detect_min;
  o.saliency.near_range = range.detect_max; // what is farther is nothing to look for
  o.saliency.min_range = std::min(o.saliency.min_range, o.saliency.near_range / 2);
  o.map.through_range = range.through;
}

void setMap(StageOptions &o, const Options &options)
{
  const Options::Map &map = options.map;
  o.map.confirm_odds = std::log(map.confirm_probability / (1 - map.confirm_probability));
  o.map.most_place_sigma = map.confirm_sigma;
  o.map.merge_distance = map.merge_distance;
  o.map.candidate_memory_s = map.candidate_memory;
  constexpr double kWindow_s = 4;
  const double window_s = map.lag > 0 ? map.lag : kWindow_s;
  o.smoothing.window = std::max(2, static_cast<int>(std::lround(window_s * rateOf(options))));
  o.smoothing.forgets = map.lag > 0;
}

void setSensors(StageOptions &o, const Options &options)
{
  const Options::Odometry &odometry = options.odometry;
  o.motion.step_sigma = odometry.step;
  o.motion.step_sigma_vertical = odometry.step_vertical;
  o.motion.scale_sigma = o.motion.step_scale_sigma = odometry.scale;
  o.motion.height_sigma = odometry.height;
  o.motion.tilt_sigma = odometry.tilt;
  o.motion.turn_sigma = odometry.turn;
  o.points.gyro.noise_density = options.gyro.noise;
  o.points.gyro.bias_sigma = options.gyro.bias;
}

/// A camera that is steered by what it tracks rests before one trunk or goes round it.
void setServoing(StageOptions &o)
{
  o.flow.track_texture = true;      // its borders slip: along lines of light and shade, and to what passes behind
  o.flow.mask_texture_edges = true; // light and shade walk over a trunk that it goes round
  o.flow.detect_leaning = true;     // a trunk of the task may lean, and there is no last look
  o.flow.search_px = 1;             // it has little else than that trunk to correct its heading by
  o.flow.view_correlation = 0.25;   // m: so long a line on the bark is taken for the border that it stands beside
  o.flow.turned_frames = 3;         // from the other side a border may be dark where it was bright
  // From one distance it sees the same heights of a trunk: bow remains, taper does not.
  o.tracking.border_correlation = 0.8;
}

} // namespace

StageOptions stageOptions(const Options &options, const PinholeCamera &camera)
{
  options.validate();
  StageOptions o;
  o.flow.use_points = options.stages.points;
  o.flow.use_saliency = options.stages.saliency;
  o.flow.final_pass = options.stages.final_pass && !options.stages.servoing && options.map.lag == 0;
  if (options.stages.servoing)
    setServoing(o);
  o.camera_height = options.camera.height;
  o.focal_sigma = options.camera.focal_sigma;
  if (options.camera.compressed)
    o.points.min_sigma_px = kCompressedSigma_px;
  scaleToRate(o, rateOf(options) / Options::kUsualRate_hz);
  setTrunks(o, options.trunks);
  setRange(o, options.range);
  o.detection.window = options.detection.window;
  o.detection.profile.range = {options.detection.elevation_low, options.detection.elevation_high};
  setMap(o, options);
  setSensors(o, options);
  constexpr double kNarrowest = 8, kWidest = 0.35; // of what the stages can be told
  scaleToCamera(o, std::clamp(camera.fx / kFocal_px, kWidest, kNarrowest));
  if (!o.flow.final_pass)
    o.map.memory = o.smoothing.forgets ? Memory::in_sight : Memory::undecided;
  o.map.forget_s = options.map.lag; // what was seen of it has left the window by then, and stays
  return o;
}
} // namespace bole
