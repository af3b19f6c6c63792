// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/candidate_track.h"

#include "smoothing/factors.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <cmath>

namespace bole
{
void DetectionWindow::push(std::shared_ptr<const Gradient> gradient, std::size_t pose, const Viewpoint &at,
                           const Smoother &smoother, const StageOptions &options)
{
  WindowView view;
  view.profile = computeLevelProfile(gradient->signed_x, at.camera, at.wMc.R, options.detection.profile);
  view.gradient = std::move(gradient);
  view.pose = pose;
  view.time_s = at.time_s;
  const Pose &bMc = smoother.options().bMc;
  const auto cameraAt = [&](const WindowView &frame) { return (smoother.pose(frame.pose) * bMc).t; };
  if (m_views.size() >= 2) { // the newest stays when the camera has moved on from the one before it
    const double moved = (cameraAt(m_views.back()) - cameraAt(m_views[m_views.size() - 2])).norm();
    if (moved < options.flow.view_spacing)
      m_views.pop_back();
  }
  m_views.push_back(std::move(view));
  const auto length = static_cast<std::size_t>(options.smoothing.window);
  const auto isMarginalised = [&] { return m_views.front().pose + length <= pose + 1; };
  while (static_cast<int>(m_views.size()) > options.detection.window || isMarginalised())
    m_views.pop_front();
}

std::vector<Detection> detectInWindow(const DetectionWindow &window, const Smoother &smoother, const TrunkMap &map,
                                      const Viewpoint &view, const vpImage<float> *p_background,
                                      const StageOptions &options)
{
  std::vector<DetectorView> views;
  for (const WindowView &frame : window.views())
    views.push_back({&frame.profile, smoother.pose(frame.pose) * options.smoothing.bMc});
  DetectorOptions detection = options.detection;
  detection.radii = map.radii();
  return detectTrunks(views, view.camera, inhibitedRanges(map, view, false), p_background, detection);
}

std::vector<LineDetection> detectInFrame(const WindowView &frame, const TrunkMap &map, const Viewpoint &view,
                                         const vpImage<float> *p_background, const StageOptions &options)
{
  ProfileOptions profile = options.detection.profile;
  LineDetectorOptions lines = options.lines;
  if (!view.has_ranges) { // without parallax, what stands upright and stays where it is must do
    p_background = nullptr;
    profile.range = kUnrangedPart;
    lines.threshold = lines.turning_threshold;
    lines.either_polarity = false; // a bright gap between trunks looks like one
  }
  return detectLines(*frame.gradient, p_background, view.camera, view.wMc.R, inhibitedRanges(map, view, true), profile,
                     lines);
}

TrunkPrior priorOf(const Trunk &guess, const SmootherOptions &options)
{
  TrunkPrior prior;
  prior.mean.xy = guess.xy;
  prior.mean.log_radius = std::log(options.prior_radius);
  prior.sigma << options.prior_position_sigma, options.prior_position_sigma, options.prior_log_radius_sigma,
      options.prior_lean_sigma, options.prior_lean_sigma;
  return prior;
}

Trunk fitTrunk(const Trunk &guess, const std::vector<TrackedView> &views, const SmootherOptions &options,
               Matrix5d *information)
{
  constexpr int kIterations = 4;   // from a detection's guess it has settled after two or three
  constexpr double kLogRadius = 1; // most that a step may change: beyond a factor of e no residual is linear
  const TrunkPrior prior = priorOf(guess, options);
  const double robust = options.summary_loss.width;
  std::vector<std::pair<SquareRootSummary, Pose>> usable;
  for (const TrackedView &view : views)
    if (SquareRootSummary root; squareRoot(view.summary, root) != SummaryStatus::indefinite)
      usable.emplace_back(root, view.wMb);
  Trunk trunk = guess;
  for (int i = 0; i < kIterations; ++i) {
    Matrix5d H = prior.sigma.cwiseAbs2().cwiseInverse().asDiagonal();
    Vector5d g = H * trunk.minus(prior.mean);
    for (const auto &[root, wMb] : usable) {
      Matrix45d J;
      const Vector4d r = residual(root, options.bMc, wMb, trunk, nullptr, &J);
      const double weight = r.norm() > robust ? robust / r.norm() : 1;
      H += weight * J.transpose() * J;
      g += weight * J.transpose() * r;
    }
    const Vector5d step = -H.ldlt().solve(g);
    trunk = trunk.plus(step * std::min(1.0, kLogRadius / std::abs(step[2])));
    if (information)
      *information = H;
  }
  return trunk;
}

void CandidateTracker::track(const Gradient &gradient, std::size_t pose, const Pose &wMb, const Viewpoint &at,
                             const TrunkMap &map, int id, const StageOptions &options)
{
  constexpr double kTilt = 0.01;   // standard deviation of the two angles that one view hardly knows [rad]
  constexpr double kBorder_px = 1; // and of bearing and half width, beside that of the trunk
  Matrix45d J;
  const RelativeTrunk relative = relativeTrunk(at.wMc, Pose(), m_guess, nullptr, &J);
  if (!relative.isFinite() || relative.cRt(2, 0) <= 0)
    return;
  TrackingPrediction prediction;
  prediction.relative = relative;
  const double sigma = kBorder_px / at.camera.fx;
  prediction.covariance = J * m_covariance * J.transpose();
  prediction.covariance.diagonal() += Vector4d(kTilt, kTilt, sigma, sigma / relative.ratio()).cwiseAbs2();
  prediction.range = elevationOf(relative, m_guess, at, options);
  const HiddenBorders hidden = hiddenBorders(m_guess, id, map, at);
  prediction.left_hidden = hidden.left;
  prediction.right_hidden = hidden.right;
  prediction.left_contrast = m_left_contrast;
  prediction.right_contrast = m_right_contrast;
  const TrackingResult result = trackTrunk(gradient, at.camera, prediction, options.tracking);
  if (result.status != TrackingStatus::tracked || !result.left_used || !result.right_used ||
      !isInsideGate(prediction, result, at.camera.fx, options.flow))
    return;
  m_views.push_back({pose, wMb, summaryOf(result, weightOfView(m_before, at.wMc.t, options.flow))});
  m_before = at.wMc.t;
  updateMeanContrast(m_left_contrast, result.left_contrast);
  updateMeanContrast(m_right_contrast, result.right_contrast);
  m_seen.push_back(viewOf(result, relative, m_guess, at, options.flow));
  m_results.push_back(result);
}

CandidateTrack CandidateTracker::fit(double found_s, const PinholeCamera &camera, const StageOptions &options) const
{
  constexpr double kUnseen = 9; // [px^2]: innovation of a hypothesis without a measurement
  CandidateTrack track;
  track.views = m_views;
  track.trunk.trunk = m_guess;
  track.trunk.covariance = m_covariance;
  track.trunk.views = m_seen;
  track.trunk.found_s = found_s;
  track.trunk.innovation2 = kUnseen;
  if (m_views.empty())
    return track;
  const SmootherOptions &smoothing = options.smoothing;
  Matrix5d information;
  track.trunk.trunk = fitTrunk(m_guess, m_views, smoothing, &information);
  track.trunk.covariance = information.inverse();
  double sum = 0;
  for (std::size_t i = 0; i < m_results.size(); ++i) {
    const RelativeTrunk expected = relativeTrunk(m_views[i].wMb, smoothing.bMc, track.trunk.trunk);
    sum += meanSquaredInnovation(m_results[i], expected, camera.fx, options.flow);
  }
  track.trunk.innovation2 = sum / static_cast<double>(m_results.size());
  return track;
}

CandidateTrack trackThroughWindow(const Hypothesis &hypothesis, const DetectionWindow &window, const Smoother &smoother,
                                  const TrunkMap &map, const Viewpoint &view, const StageOptions &options)
{
  CandidateTracker tracker(hypothesis.trunk, hypothesis.covariance);
  Viewpoint at = view;
  for (const WindowView &frame : window.views()) {
    const Pose wMb = smoother.pose(frame.pose);
    at.wMc = wMb * options.smoothing.bMc;
    at.time_s = frame.time_s;
    tracker.track(*frame.gradient, frame.pose, wMb, at, map, hypothesis.id, options);
  }
  return tracker.fit(view.time_s, view.camera, options);
}

CandidateTrack trackThroughWindow(const Detection &detection, const DetectionWindow &window, const Smoother &smoother,
                                  const TrunkMap &map, const Viewpoint &view, const StageOptions &options)
{
  CandidateTrack track = trackThroughWindow(Hypothesis{-1, detection.trunk}, window, smoother, map, view, options);
  if (track.views.empty()) {
    track.trunk.covariance.setIdentity();
    track.trunk.covariance.topLeftCorner<3, 3>() = detection.covariance;
  }
  return track;
}

std::optional<CandidateTrack> trackInFrame(const LineDetection &detection, const WindowView &frame,
                                           const Smoother &smoother, const Viewpoint &view, const StageOptions &options)
{
  const double radius = options.smoothing.prior_radius;
  TrackingPrediction prediction;
  prediction.relative = detection.relative;
  prediction.range =
      elevationOf(detection.relative, trunkFromRelative(view.wMc, detection.relative, radius), view, options);
  const TrackingResult result = trackTrunk(*frame.gradient, view.camera, prediction, options.tracking);
  if (result.status != TrackingStatus::tracked || !result.left_used || !result.right_used)
    return std::nullopt;
  CandidateTrack track;
  track.trunk.trunk = trunkFromRelative(view.wMc, result.optimum, radius);
  track.trunk.found_s = view.time_s;
  track.views.push_back({frame.pose, smoother.pose(frame.pose), summaryOf(result, 1)});
  track.trunk.views.push_back(viewOf(result, prediction.relative, track.trunk.trunk, view, options.flow));
  return track;
}
} // namespace bole
