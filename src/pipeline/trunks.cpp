// SPDX-License-Identifier: GPL-2.0-or-later
// What the pipeline does with trunks: follows those it knows, looks for new ones and takes them into the map.
#include <bole/pipeline.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
/// Where no range is known: what trunks fill that stand far away too, and whatever the pitch is wrong by.
constexpr ElevationRange kTurningRange = {-0.06, 0.2};

double bearingOf(const Pose &wMc, const Trunk &trunk)
{
  const Eigen::Vector2d w = trunk.xy - wMc.t.head<2>();
  return std::atan2(w.y(), w.x());
}
} // namespace

ElevationRange Pipeline::elevation(const RelativeTrunk &relative, const Trunk &trunk, const Pose &wMc) const
{
  if (isTurning())
    return kTurningRange;
  if (!m_ground_z)
    return m_options.detection.profile.range;
  const double d = trunk.radius() / relative.ratio();
  const double tangent = std::sqrt(std::max(d * d - trunk.radius() * trunk.radius(), 0.01));
  const double above = wMc.t.z() - *m_ground_z;
  return {(m_options.flow.trunk_low - above) / tangent, (m_options.flow.trunk_high - above) / tangent};
}

/// Borders behind nearer trunks of the map are hidden.
void Pipeline::hide(TrackingPrediction &prediction, const MapTrunk &trunk, const Pose &wMc) const
{
  const double range = (trunk.trunk.xy - wMc.t.head<2>()).norm();
  const double bearing = bearingOf(wMc, trunk.trunk), half = std::asin(std::min(0.99, trunk.trunk.radius() / range));
  for (const std::size_t i : m_map.active()) {
    const MapTrunk &other = m_map.trunks()[i];
    if (other.id == trunk.id || other.status != TrunkStatus::confirmed)
      continue;
    const double other_range = (other.trunk.xy - wMc.t.head<2>()).norm();
    if (other_range > range - 0.2)
      continue;
    const double other_half = std::asin(std::min(0.99, other.trunk.radius() / other_range)) + 2 / m_camera.fx;
    const double apart = std::remainder(bearing - bearingOf(wMc, other.trunk), 2 * M_PI);
    prediction.left_hidden |= std::abs(apart + half) < other_half;
    prediction.right_hidden |= std::abs(apart - half) < other_half;
  }
}

TrackingPrediction Pipeline::predict(const MapTrunk &trunk, const RelativeTrunk &relative, const Matrix4d &covariance,
                                     const Pose &wMc) const
{
  TrackingPrediction prediction;
  prediction.relative = relative;
  prediction.covariance = covariance;
  prediction.range = elevation(relative, trunk.trunk, wMc);
  prediction.left_contrast = trunk.left_contrast;
  prediction.right_contrast = trunk.right_contrast;
  hide(prediction, trunk, wMc);
  return prediction;
}

/// Mean square of the borders found against those expected [px^2], less the wider the trunk stands in the image
/// (its borders are rougher) and the weaker they are (noise moves them).
double Pipeline::misfit(const TrackingResult &tracked, const RelativeTrunk &expected) const
{
  const Eigen::Vector2d moved = m_camera.fx * tracked.optimum.minus(expected).tail<2>();
  const double widened = tracked.left_used && tracked.right_used ? moved(1) * tracked.optimum.ratio() : 0;
  const double width_px = 2 * m_camera.fx * tracked.optimum.ratio();
  const double weakest = std::max(tracked.left_used && tracked.right_used
                                      ? std::min(std::abs(tracked.left_contrast), std::abs(tracked.right_contrast))
                                      : std::abs(tracked.left_contrast + tracked.right_contrast),
                                  1e-3);
  return std::min(moved(0) * moved(0) + widened * widened, 9.0) /
         (1 + std::pow(width_px / 20, 2) + std::pow(m_options.flow.contrast_noise / weakest, 2));
}

/// Share of its information that a view from \p camera adds to the one before.
double Pipeline::weightOfView(const MapTrunk &trunk, const Eigen::Vector3d &camera) const
{
  constexpr double kLeast = 0.05; // holds the pose of a drone at rest
  if (m_options.flow.view_correlation <= 0 || !trunk.seen_from)
    return 1;
  return std::clamp((camera - *trunk.seen_from).norm() / m_options.flow.view_correlation, kLeast, 1.0);
}

bool Pipeline::observe(MapTrunk &trunk, std::size_t pose, const TrackingPrediction &prediction,
                       const TrackingResult &tracked, double time_s)
{
  const double weight = weightOfView(trunk, cameraAt(pose).t);
  const SummaryFactor summary{tracked.optimum, weight * tracked.energy, weight * tracked.f, weight * tracked.F};
  if (m_smoother.addObservation(pose, trunk.smoother_id, summary) != SummaryStatus::ok)
    return false;
  trunk.seen_from = cameraAt(pose).t;
  const double innovation2 = misfit(tracked, prediction.relative);
  m_map.recordView(trunk, {time_s, bearingOf(cameraAt(pose), trunk.trunk), tracked.left_contrast,
                           tracked.right_contrast, tracked.evenness, innovation2});
  return true;
}

void Pipeline::trackKnown(const Gradient &gradient, double time_s, FrameResult &result)
{
  const std::size_t pose = m_smoother.poseCount() - 1;
  const Pose wMc = cameraAt(pose);
  for (const std::size_t i : m_map.active()) {
    MapTrunk &trunk = m_map.trunks()[i];
    const double range = (trunk.trunk.xy - wMc.t.head<2>()).norm();
    if (!isTurning() && range > m_options.flow.track_range)
      continue;
    const RelativeTrunk relative = m_smoother.predictedRelative(trunk.smoother_id);
    if (!relative.isFinite() || relative.cRt(2, 0) <= 0) // behind the camera
      continue;
    Matrix4d covariance = m_smoother.relativeCovariance(trunk.smoother_id);
    covariance(2, 2) += missedVariance(trunk.misses_in_a_row);
    const TrackingPrediction prediction = predict(trunk, relative, covariance, wMc);
    TrackingResult tracked = trackTrunk(gradient, m_camera, prediction, m_options.tracking);
    if (tracked.status == TrackingStatus::tracked && !insideGate(prediction, tracked))
      tracked.status = TrackingStatus::diverged;
    if (confirmTurn(trunk, prediction, tracked))
      tracked.status = TrackingStatus::tracked;
    if (tracked.status == TrackingStatus::not_visible)
      continue;
    if (tracked.status == TrackingStatus::tracked)
      observe(trunk, pose, prediction, tracked, time_s);
    else if (tracked.status != TrackingStatus::occluded)
      m_map.recordMiss(trunk);
    if (result.saliency && !isTurning() && tracked.status == TrackingStatus::tracked) {
      const double foreground =
          foregroundBetween(result.saliency->p_background, m_camera, tracked.optimum, prediction.range);
      if (foreground >= 0)
        m_map.recordForeground(trunk, range, foreground);
    }
    result.trunks.push_back({trunk.id, trunk.status, tracked.status,
                             tracked.status == TrackingStatus::tracked ? tracked.optimum : relative, prediction.range,
                             isTurning() ? 0 : range});
  }
}

/// Takes down whether the borders found have the other sign, but stand where they are expected; true when they have
/// done so for long enough.
bool Pipeline::confirmTurn(MapTrunk &trunk, const TrackingPrediction &prediction, const TrackingResult &tracked) const
{
  TrackingPrediction narrow = prediction;
  narrow.covariance(2, 2) -= missedVariance(trunk.misses_in_a_row);
  const bool is_near = tracked.status == TrackingStatus::sign_changed && insideGate(narrow, tracked);
  trunk.turned_in_a_row = is_near ? trunk.turned_in_a_row + 1 : 0;
  return m_options.flow.turned_frames > 0 && trunk.turned_in_a_row >= m_options.flow.turned_frames;
}

/// Of the bearing of a trunk that was missed: what a prediction is wrong by is wrong by more in the next frame.
double Pipeline::missedVariance(int misses) const
{
  const double sigma_px = std::min(m_options.flow.search_px * misses, m_options.tracking.scan_max_px / 3);
  return std::pow(sigma_px / m_camera.fx, 2);
}

/// Bearing and log r/d against the prediction.
bool Pipeline::insideGate(const TrackingPrediction &prediction, const TrackingResult &tracked) const
{
  const Eigen::Vector2d innovation = tracked.optimum.minus(prediction.relative).tail<2>();
  const double s_px = m_options.flow.gate_sigma_px / m_camera.fx;
  Eigen::Matrix2d S = prediction.covariance.bottomRightCorner<2, 2>();
  S(0, 0) += s_px * s_px;
  S(1, 1) += std::pow(s_px / prediction.relative.ratio(), 2) + 0.0025; // taper
  if (!tracked.left_used || !tracked.right_used)
    return innovation(0) * innovation(0) <= m_options.flow.gate * S(0, 0);
  return innovation.dot(S.inverse() * innovation) <= m_options.flow.gate;
}

void Pipeline::keepView(const Frame &frame, Gradient gradient)
{
  const std::size_t pose = m_smoother.poseCount() - 1;
  const Pose wMc = cameraAt(pose);
  View view;
  view.profile = computeLevelProfile(gradient.signed_x, m_camera, wMc.R, m_options.detection.profile);
  view.gradient = std::move(gradient);
  view.pose = pose;
  view.time_s = 1e-9 * static_cast<double>(frame.stamp_ns);
  // the newest view always stands last; it stays when the camera has moved on from the one before it
  if (m_views.size() >= 2) {
    const double moved = (cameraAt(m_views.back().pose).t - cameraAt(m_views[m_views.size() - 2].pose).t).norm();
    if (moved < m_options.flow.view_spacing)
      m_views.pop_back();
  }
  m_views.push_back(std::move(view));
  const auto lag = static_cast<std::size_t>(m_options.smoothing.fixed_lag);
  const auto is_closed = [&] {
    return lag > 0 && m_views.front().pose + lag <= pose + 1;
  }; // nothing more is told of it
  while (static_cast<int>(m_views.size()) > m_options.detection.window || is_closed())
    m_views.pop_front();
}

/// Places in the image where the detectors need not look: those of confirmed trunks and, for the detector that asks one
/// frame (Eq. 21), of candidates. The one that asks a window may come to a better reading of a candidate's lines.
std::vector<InhibitedRange> Pipeline::inhibited(bool by_candidates) const
{
  std::vector<InhibitedRange> ranges;
  const Pose wMc = cameraAt(m_smoother.poseCount() - 1);
  const Eigen::Vector2d forward = wMc.R.col(2).head<2>().normalized(), left(-forward.y(), forward.x());
  for (const std::size_t i : m_map.active()) {
    const MapTrunk &trunk = m_map.trunks()[i];
    const Eigen::Vector2d w = trunk.trunk.xy - wMc.t.head<2>();
    const double r = trunk.trunk.radius(), d2 = w.squaredNorm();
    const bool inhibits =
        trunk.status == TrunkStatus::confirmed || (by_candidates && trunk.status == TrunkStatus::candidate);
    if (!inhibits || w.dot(forward) < 0.3 || d2 < 1.1 * r * r)
      continue;
    const double q = w.dot(left) / w.dot(forward), half = r / std::sqrt(d2 - r * r);
    ranges.push_back({q - half - 1 / m_camera.fx, q + half + 1 / m_camera.fx});
  }
  return ranges;
}

void Pipeline::detectNew(FrameResult &result)
{
  if (m_online.size() % static_cast<std::size_t>(m_options.flow.detect_every) != 0)
    return;
  const bool has_ranges = !isTurning() && (m_visual || m_ground_z);
  if ((m_options.flow.detect_lines || !has_ranges) && result.saliency)
    detectSingle(result);
  if (!m_options.flow.detect_window || !has_ranges)
    return;
  std::vector<DetectorView> views;
  for (const View &view : m_views)
    views.push_back({&view.profile, cameraAt(view.pose)});
  result.detections = detectTrunks(views, m_camera, inhibited(false),
                                   result.saliency ? &result.saliency->p_background : nullptr, m_options.detection);
  int adopted = 0;
  for (const Detection &detection : result.detections) // best first
    if (!m_map.holds(detection.trunk) && adopted < m_options.flow.adopt_most) {
      adopt(detection);
      ++adopted;
    }
}

void Pipeline::detectSingle(FrameResult &result)
{
  const Pose wMc = cameraAt(m_smoother.poseCount() - 1);
  // without parallax, what stands upright and stays where it is must do
  const vpImage<float> *p_background = isTurning() ? nullptr : &result.saliency->p_background;
  ProfileOptions profile = m_options.detection.profile;
  LineDetectorOptions lines = m_options.lines;
  if (isTurning()) {
    profile.range = kTurningRange;
    lines.threshold = lines.turning_threshold;
    lines.either_polarity = false; // without parallax a bright gap between trunks looks like one
  }
  result.lines = detectLines(m_views.back().gradient, p_background, m_camera, wMc.R, inhibited(true), profile, lines);
  for (const LineDetection &line : result.lines)
    adopt(line);
}

/// One view: the range is that of the prior on the radius.
void Pipeline::adopt(const LineDetection &detection)
{
  const View &view = m_views.back();
  const Pose wMc = cameraAt(view.pose);
  const Trunk guess = trunkFromRelative(wMc, detection.relative, m_options.smoothing.prior_radius);
  TrackingPrediction prediction;
  prediction.relative = detection.relative;
  prediction.range = elevation(detection.relative, guess, wMc);
  const TrackingResult tracked = trackTrunk(view.gradient, m_camera, prediction, m_options.tracking);
  if (tracked.status != TrackingStatus::tracked || !tracked.left_used || !tracked.right_used)
    return;
  const Trunk seen = trunkFromRelative(wMc, tracked.optimum, m_options.smoothing.prior_radius);
  MapTrunk &trunk = m_map.add(m_smoother.addTrunk(seen), seen);
  observe(trunk, view.pose, prediction, tracked, view.time_s);
  trunk.innovation2 = 0;
  m_smoother.update();
}

/// A detection becomes a candidate, with what the views of the window saw of it.
void Pipeline::adopt(const Detection &detection)
{
  const std::size_t smoother_id = m_smoother.addTrunk(detection.trunk);
  MapTrunk &trunk = m_map.add(smoother_id, detection.trunk);
  trunk.covariance.topLeftCorner<3, 3>() = detection.covariance;
  std::vector<std::pair<std::size_t, TrackingResult>> seen;
  for (const View &view : m_views) {
    const Pose wMc = cameraAt(view.pose);
    const RelativeTrunk relative = relativeTrunk(wMc, Pose(), detection.trunk);
    if (!relative.isFinite() || relative.cRt(2, 0) <= 0)
      continue;
    Matrix4d covariance = Matrix4d::Zero();
    covariance.diagonal() << 1e-4, 1e-4, std::pow(1.0 / m_camera.fx, 2),
        std::pow(1.0 / m_camera.fx / relative.ratio(), 2);
    TrackingPrediction prediction = predict(trunk, relative, covariance, wMc);
    const TrackingResult tracked = trackTrunk(view.gradient, m_camera, prediction, m_options.tracking);
    if (tracked.status == TrackingStatus::tracked && insideGate(prediction, tracked) && tracked.left_used &&
        tracked.right_used && observe(trunk, view.pose, prediction, tracked, view.time_s))
      seen.emplace_back(view.pose, tracked);
  }
  if (seen.empty())
    trunk.first_seen_s = trunk.last_seen_s = m_views.back().time_s; // waits for its first view
  trunk.hits = 0; // it was fitted to these: only what comes after puts it to the test
  m_smoother.update();
  const Trunk fitted = m_smoother.trunk(smoother_id);
  double sum = 0;
  for (const auto &[pose, tracked] : seen)
    sum += misfit(tracked, relativeTrunk(m_smoother.pose(pose), m_bMc, fitted));
  trunk.innovation2 = seen.empty() ? 9 : sum / static_cast<double>(seen.size());
}
} // namespace bole
