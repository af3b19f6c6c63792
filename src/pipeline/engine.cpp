// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/engine.h"

#include "geometry/constants.h"
#include "geometry/silhouette.h"
#include "pipeline/scene_points.h"

#include <algorithm>
#include <chrono>
#include <iterator>

namespace bole
{
namespace
{
/// Times the stages of a frame one after the other.
class Laps
{
public:
  void operator()(const char *stage)
  {
    const auto now = std::chrono::steady_clock::now();
    times_ms.emplace_back(stage, std::chrono::duration<double, std::milli>(now - m_last).count());
    m_last = now;
  }

  std::vector<std::pair<const char *, double>> times_ms;

private:
  std::chrono::steady_clock::time_point m_last = std::chrono::steady_clock::now();
};

StageOptions withCamera(StageOptions options, const Pose &bMc)
{
  options.smoothing.bMc = bMc;
  return options;
}

const vpImage<float> *background(const std::optional<Saliency> &saliency)
{
  return saliency ? &saliency->p_background : nullptr;
}

std::optional<SaliencyField> fieldOf(std::optional<Saliency> saliency)
{
  if (!saliency)
    return std::nullopt;
  return SaliencyField{std::move(saliency->p_background), std::move(saliency->confidence), kUnknownBelow};
}

/// Whether two detections are of one trunk: their axes are nearer than the smaller radius, and their radii differ by
/// less than a quarter.
bool isSameDetection(const Trunk &a, const Trunk &b)
{
  return distanceBetween(a, b) < std::min(a.radius(), b.radius()) && std::abs(a.log_radius - b.log_radius) < 0.25;
}

bool isDropped(SummaryStatus status)
{
  return status == SummaryStatus::indefinite || status == SummaryStatus::not_finite;
}

std::vector<TrunkInView> inView(const std::vector<TrackedTrunk> &tracked, const TrunkMap &map, bool has_ranges)
{
  std::vector<TrunkInView> trunks;
  for (const TrackedTrunk &trunk : tracked) {
    const TrackingStatus status = trunk.result.status;
    if (status == TrackingStatus::not_visible)
      continue;
    const PredictedTrunk &predicted = trunk.predicted;
    const bool is_tracked = status == TrackingStatus::tracked;
    trunks.push_back({predicted.id, map.trunk(predicted.id).status, is_tracked, toString(status),
                      is_tracked ? trunk.result.optimum : predicted.tracking.relative, predicted.tracking.range.low,
                      predicted.tracking.range.high, has_ranges ? predicted.range : 0});
  }
  return trunks;
}
} // namespace

Engine::Engine(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options)
    : m_camera(camera),
      m_bMc(bMc),
      m_options(withCamera(options, bMc)),
      m_units(m_options),
      m_saliency(camera, options.saliency),
      m_smoother(m_options.smoothing),
      m_map(options.map)
{
}

FrameReport Engine::process(const Frame &as_it_came)
{
  Laps lap;
  FrameReport report;
  const Motion motion = estimateMotion(as_it_came); // by gyro, pose filter and points, or by the images alone
  Frame scratch;
  const Frame &frame = asUsuallyExposed(as_it_came, motion, scratch);
  lap("motion");
  const Viewpoint view = extendTrajectory(frame, motion); // Eq. 2: the next pose, and all that was seen before it
  lap("smoothing");
  if (frame.status == FrameStatus::ok && motion.image_fault.empty()) {
    const auto gradient = std::make_shared<const Gradient>(computeGradient(frame.image, m_units.gradient)); // Eq. 3
    lap("gradient");
    std::optional<Saliency> saliency = estimateSaliency(frame, motion); // Eq. 10-17
    lap("saliency");
    std::vector<PredictedTrunk> predicted = predictTrunks(m_map, m_smoother, view, m_units); // Eq. 5-8
    dropUncertain(predicted, view);
    if (m_units.flow.mask_texture_edges)
      maskTextureEdges(predicted);
    if (m_units.flow.track_texture && view.has_ranges && newest() > 0)
      m_texture.predict(frame.image, newest(), cameraAt(newest() - 1), view, m_map, predicted);
    const std::vector<TrackedTrunk> tracked =
        trackTrunks(frame.image, *gradient, predicted, m_map, view, m_units); // Eq. 3-4
    if (m_units.flow.track_texture)
      m_texture.correct(tracked, view.camera);
    add(tracked, view); // Eq. 9
    lap("tracking");
    m_window.push(gradient, newest(), view, m_smoother, m_units);
    scoreByConsistency(frame, tracked, view);
    addNewCandidates(view, background(saliency)); // Eq. 18-21
    if (m_units.flow.detect_leaning)
      addLeaningCandidates(gradient, view, background(saliency));
    lap("detection");
    report.trunks = inView(tracked, m_map, view.has_ranges);
    report.points = points();
    report.given_up = reviewMap(report.points, view); // Sec. 7
    lap("map");
    report.map = knownTrunks(predicted, view);
    report.saliency = fieldOf(std::move(saliency));
  }
  report.timing_ms = std::move(lap.times_ms);
  return completeReport(std::move(report), frame, motion);
}

Motion Engine::estimateMotion(const Frame &frame)
{
  if (m_motion)
    return m_motion->step(frame, m_smoother.pose(newest()), m_velocity);
  m_motion = makeMotionSource(frame, m_camera, m_bMc, m_options);
  SmootherOptions options = m_options.smoothing;
  options.max_iterations = m_motion->iterations(options.max_iterations);
  m_smoother = Smoother(options);
  Motion motion;
  motion.start = m_motion->first(frame);
  return motion;
}

/// \p frame with the image as an exposure that never changed would have made it, in \p scratch: all that follows
/// compares brightness between frames. What the exposure settles at becomes usual.
const Frame &Engine::asUsuallyExposed(const Frame &frame, const Motion &motion, Frame &scratch)
{
  constexpr double kUsual_s = 10;         // longer than a trunk is in sight
  constexpr std::size_t kSaturated = 250; // grey level: how much light there was is not known
  if (frame.status != FrameStatus::ok || !motion.image_fault.empty())
    return frame;
  const double elapsed_s = m_online.empty() ? 0 : secondsOf(frame.stamp_ns - m_online.back().stamp_ns);
  m_brightness = m_brightness * std::exp(-elapsed_s / kUsual_s) + m_motion->points().tracker().brightnessChange();
  if (m_brightness == 0)
    return frame;
  unsigned char level[256];
  for (std::size_t i = 0; i < std::size(level); ++i)
    level[i] = static_cast<unsigned char>(
        i >= kSaturated ? i : std::lround(std::min(255.0, std::exp(-m_brightness) * static_cast<double>(i))));
  scratch = frame;
  scratch.image.performLut(level);
  return scratch;
}

/// By the points of this frame, or level where the motion itself rests on a level ground.
std::optional<GroundPlane> Engine::groundUnder(const Frame &frame, const Motion &motion)
{
  if (m_motion->isTranslationMeasured())
    return m_ground_filter.add(
        frame.status == FrameStatus::ok && motion.image_fault.empty() ? points() : std::vector<TriangulatedRay>(),
        cameraAt(newest()).t);
  const std::optional<double> level = m_motion->groundZ();
  return level ? std::optional(GroundPlane{cameraAt(newest()).t.head<2>(), *level, {0, 0}}) : std::nullopt;
}

/// Adds the pose of this frame to the smoother and updates it once, together with the measurements of trunks in the
/// frame before: all later stages use the pose that this update estimates.
Viewpoint Engine::extendTrajectory(const Frame &frame, const Motion &motion)
{
  constexpr double kLately_s = 1; // the covariance of a trunk that was not seen for longer hardly changes
  if (motion.has_new_unit)
    apply(m_map.removeUnranged());
  if (motion.start)
    m_smoother.addFirstPose(motion.start->mean, motion.start->covariance);
  else {
    const std::size_t pose = m_smoother.addPose(motion.step.aMb, motion.step.covariance);
    if (motion.step.absolute)
      m_smoother.addPosePrior(pose, *motion.step.absolute);
  }
  for (const OdometryBetween &between : motion.odometry)
    m_smoother.addOdometry(between.a, between.b, between.odometry);
  for (const DirectionBetween &between : motion.directions)
    m_smoother.addRelativePose(between.a, between.b, between.measurement);
  m_smoother.update();
  refreshMap(secondsOf(frame.stamp_ns) - kLately_s);
  m_ground.push_back(groundUnder(frame, motion));
  return viewpointOf(newest(), secondsOf(frame.stamp_ns));
}

std::optional<Saliency> Engine::estimateSaliency(const Frame &frame, const Motion &motion)
{
  constexpr double kRotation = 1e-3, kTranslation = 1e-2; // standard deviations between two smoothed poses [rad], [m]
  if (!m_units.flow.use_saliency)
    return std::nullopt;
  std::optional<RotationPrior> rotation;
  std::optional<TranslationPrior> translation;
  if (newest() > 0) {
    const Pose pMc = cameraAt(newest() - 1).inverse() * cameraAt(newest());
    if (motion.is_rotation_seen)
      rotation = RotationPrior{pMc.R, kRotation * kRotation * Eigen::Matrix3d::Identity()};
    if (motion.step.is_step_measured)
      translation = TranslationPrior{pMc.t, kTranslation * kTranslation * Eigen::Matrix3d::Identity()};
  }
  return m_saliency.update(frame.image, rotation, translation);
}

/// Drops the predictions of trunks that were out of sight while the path drifted by more than their width: a neighbour
/// could be associated with them. Such a trunk is detected as a new one, and the map merges both visits once both are
/// known.
void Engine::dropUncertain(std::vector<PredictedTrunk> &predicted, const Viewpoint &view)
{
  constexpr double kOutOfSight_s = 1; // less: a view that failed, of a trunk that is followed
  const auto first = std::stable_partition(predicted.begin(), predicted.end(), [&](const PredictedTrunk &one) {
    return one.is_placed || view.time_s - m_map.trunk(one.id).last_seen_s < kOutOfSight_s;
  });
  std::for_each(first, predicted.end(), [this](const PredictedTrunk &one) { m_map.markOutOfSight(one.id); });
  predicted.erase(first, predicted.end());
}

/// Replaces the image of each trunk tracked by a summary factor.
void Engine::add(const std::vector<TrackedTrunk> &tracked, const Viewpoint &view)
{
  constexpr double kOnePlace = 0.05; // weight of a view from a camera that only turns: all views share one error
  for (const TrackedTrunk &trunk : tracked) {
    if (trunk.result.status == TrackingStatus::tracked) {
      const double weight = view.has_ranges
                                ? weightOfView(m_map.trunk(trunk.predicted.id).seen_from, view.wMc.t, m_units.flow)
                                : kOnePlace;
      if (isDropped(m_smoother.addObservation(newest(), trunk.predicted.smoother_id, summaryOf(trunk.result, weight))))
        continue;
    }
    m_map.record(measurementOf(trunk, m_map, view, m_units.flow));
  }
}

/// Detects trunks that the map does not know and adds them as candidates.
void Engine::addNewCandidates(const Viewpoint &view, const vpImage<float> *p_background)
{
  const FlowOptions &flow = m_units.flow;
  if (newest() % static_cast<std::size_t>(flow.detect_every) != 0)
    return;
  const bool has_ranges = m_motion->isTranslationMeasured();
  if (p_background && !has_ranges)
    for (const LineDetection &line : detectInFrame(m_window.newest(), m_map, view, p_background, m_units))
      if (const auto track = trackInFrame(line, m_window.newest(), m_smoother, view, m_units))
        addCandidate(*track);
  if (!has_ranges)
    return;
  addBestCandidates(detectInWindow(m_window, m_smoother, m_map, view, p_background, m_units), m_window, view);
}

/// Adds the best detection of each set of lines to the map, unless the map knows it. A detection whose candidate was
/// rejected is not tried again before half of the window is new, so that the next best has its turn (inhibition of
/// return). \p found: in \p window, best first.
void Engine::addBestCandidates(std::vector<Detection> found, const DetectionWindow &window, const Viewpoint &view)
{
  const std::size_t now = window.newest().pose, half = static_cast<std::size_t>(m_units.detection.window) / 2;
  while (!m_tried.empty() && (m_tried.front().pose > now || m_tried.front().pose + half <= now))
    m_tried.pop_front();
  const auto wasGivenUp = [this](const Detection &detection) {
    return std::any_of(m_tried.begin(), m_tried.end(), [&](const TriedDetection &tried) {
      return !m_map.isActive(tried.id) && isSameDetection(tried.trunk, detection.trunk);
    });
  };
  found.erase(std::remove_if(found.begin(), found.end(), wasGivenUp), found.end());
  int added = 0;
  for (const Detection &detection : suppressNonMaxima(found))
    if (!m_map.associate(detection.trunk) && added < m_units.flow.most_new_candidates) { // the best come first
      const CandidateTrack track = trackThroughWindow(detection, window, m_smoother, m_map, view, m_units);
      m_tried.push_back({addCandidate(track), now, detection.trunk});
      ++added;
    }
}

int Engine::addCandidate(const CandidateTrack &track) { return m_map.add(addToSmoother(track)); }

/// Adds a candidate and its views to the smoother and returns it with its id there.
NewTrunk Engine::addToSmoother(const CandidateTrack &track)
{
  NewTrunk added = track.trunk;
  added.smoother_id = m_smoother.addTrunk(added.trunk, priorOf(added.trunk, m_units.smoothing));
  for (const TrackedView &view : track.views)
    m_smoother.addObservation(view.pose, added.smoother_id, view.summary);
  return added;
}

std::vector<TriangulatedRay> Engine::points() const
{
  constexpr int kBack = 15; // frames between the two views of a point, at most
  const PointMotion &points = m_motion->points();
  if (points.framesBack() < 2 || !m_motion->hasRanges())
    return {};
  std::vector<Pose> wMc; // by good frames back
  for (int back = 0; back <= std::min(kBack, points.framesBack()); ++back)
    wMc.push_back(cameraAt(points.frameIndex(back)));
  return triangulate(points.tracker(), wMc, m_camera);
}

/// Reviews the map and returns the ids of the hypotheses that it archived.
std::vector<int> Engine::reviewMap(const std::vector<TriangulatedRay> &points, const Viewpoint &view)
{
  for (const PointCount &count : countPoints(points, m_map, view, m_units))
    m_map.record(count);
  MapUpdate update = m_map.review(view.time_s, view.has_ranges);
  apply(update);
  keepConfirmed();
  return std::move(update.archived);
}

/// What leaves the smoother's window tells of confirmed trunks alone.
void Engine::keepConfirmed()
{
  for (const std::size_t i : m_map.active()) {
    const MapTrunk &trunk = m_map.trunks()[i];
    m_smoother.keepTrunk(trunk.smoother_id, trunk.status != TrunkStatus::candidate);
  }
}

TrunkEstimate Engine::estimateOf(const MapTrunk &trunk, bool with_covariance) const
{
  TrunkEstimate estimate{trunk.id, m_smoother.trunk(trunk.smoother_id), std::nullopt};
  if (with_covariance) {
    estimate.covariance = m_smoother.trunkCovariance(trunk.smoother_id);
    estimate.place_covariance = m_smoother.placeCovariance(trunk.smoother_id);
  }
  return estimate;
}

/// Takes the estimates of active trunks over into the map; covariances only of trunks seen after \p seen_since_s, since
/// that of an older one costs a walk through the flight since then.
void Engine::refreshMap(double seen_since_s)
{
  for (const std::size_t i : m_map.active()) {
    const MapTrunk &trunk = m_map.trunks()[i];
    m_map.refresh(estimateOf(trunk, trunk.last_seen_s >= seen_since_s));
  }
}

/// Takes all estimates over into the map, also those of inactive candidates; covariances of trunks with enough views
/// for a decision.
void Engine::refreshWholeMap()
{
  for (const MapTrunk &trunk : m_map.trunks())
    if (!trunk.removed)
      m_map.refresh(estimateOf(trunk, !trunk.inactive || trunk.observations >= m_units.map.confirm_observations));
}

void Engine::apply(const MapUpdate &update)
{
  for (const MapUpdate::Merge &merge : update.merged)
    m_smoother.mergeTrunks(merge.keep, merge.gone);
  for (const std::size_t trunk : update.removed)
    m_smoother.removeTrunk(trunk);
}

/// The trunks near the camera. The variance of a bearing comes from the prediction where the trunk was predicted, from
/// the fit where it was detected in this frame, and else from the smoother.
std::vector<KnownTrunk> Engine::knownTrunks(const std::vector<PredictedTrunk> &predicted, const Viewpoint &view) const
{
  constexpr double kFar = 20; // [m]: trunks beyond it are not reported
  std::vector<KnownTrunk> trunks;
  for (const std::size_t i : m_map.active()) {
    const MapTrunk &trunk = m_map.trunks()[i];
    Matrix45d J;
    const RelativeTrunk relative = relativeTrunk(view.wMc, Pose(), trunk.trunk, nullptr, &J);
    if (horizontalView(view.wMc, trunk.trunk).range * m_metres > kFar || !relative.isFinite()) // the camera is in it
      continue;
    const auto looked_for =
        std::find_if(predicted.begin(), predicted.end(), [&](const PredictedTrunk &one) { return one.id == trunk.id; });
    const bool is_new = trunk.hits + trunk.misses == 0;
    const double variance = looked_for != predicted.end()
                                ? looked_for->tracking.covariance(2, 2) - looked_for->missed_variance
                            : is_new ? (J * trunk.covariance * J.transpose())(2, 2)
                                     : m_smoother.bearingVariance(trunk.smoother_id);
    trunks.push_back({trunk.id, trunk.status, trunk.trunk, trunk.observations, m_map.evidence(trunk),
                      trunk.isGap() ? trunk.seeThroughRatio() : 0, trunk.covariance(2, 2), variance});
  }
  return trunks;
}

FrameReport Engine::completeReport(FrameReport report, const Frame &frame, const Motion &motion)
{
  const Pose wMb = m_smoother.pose(newest());
  if (newest() > 0) {
    constexpr double kLeast_s = 1e-3; // a stamp that hardly advances tells no velocity
    const double dt = secondsOf(frame.stamp_ns - m_online.back().stamp_ns);
    if (dt >= kLeast_s)
      m_velocity = wMb.minus(m_smoother.pose(newest() - 1)) / dt;
    updateScale(dt);
  }
  m_online.push_back({frame.stamp_ns, wMb});
  report.index = newest();
  report.stamp_ns = frame.stamp_ns;
  report.gap_s = frame.gap_s;
  report.frame_status = motion.image_fault.empty() ? frame.status : FrameStatus::doubtful;
  report.reason = motion.image_fault.empty() ? frame.message : motion.image_fault;
  report.wMb = wMb;
  report.wMc = wMb * m_bMc;
  report.pose_covariance = m_smoother.currentPoseCovariance();
  report.is_translation_seen = motion.step.is_step_measured;
  report.is_odometry_used = motion.is_odometry_used;
  report.has_ranges = m_motion->hasRanges();
  report.verdicts = m_motion->verdicts();
  toMetres(report, m_bMc, m_metres);
  return report;
}

void Engine::finish()
{
  if (m_smoother.poseCount() == 0)
    return;
  m_smoother.optimize(kSettled);
  refreshWholeMap();
  if (m_units.flow.final_pass && m_motion->hasRanges())
    runFinalPass();
  else {
    const MapUpdate update = m_map.reviewAll(m_motion->hasRanges());
    apply(update);
    if (!update.merged.empty() || !update.removed.empty()) {
      m_smoother.optimize(kSettled);
      refreshWholeMap();
    }
  }
  fixScale();
  indexViews();
}

} // namespace bole
