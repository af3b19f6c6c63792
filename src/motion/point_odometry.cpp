// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/point_odometry.h"

#include "geometry/median.h"

#include "geometry/constants.h"
#include "motion/bundle.h"
#include "motion/epipolar.h"
#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <unordered_map>

namespace bole
{
namespace
{
using motion::BundleFrame;
using motion::BundleOptions;
using motion::BundlePoint;
using motion::BundleResult;

using Seen = std::unordered_map<std::uint64_t, Eigen::Vector2d>; ///< normalised positions by track

struct KeyFrame
{
  std::size_t frame = 0; ///< index of all frames
  Pose wMc;
  Seen seen;
  std::optional<GyroRotation> turned; ///< since the key frame before
};

struct Landmark
{
  std::size_t anchor = 0; ///< frame index of its key frame
  Eigen::Vector2d xy;     ///< in the anchor
  double inverse_depth = 0, information = 0;
  int misses = 0; ///< windows in which most of its observations were rejected
};

/// The pose of a frame relative to its key frame.
struct Record
{
  std::size_t key = 0; ///< frame index of the key frame
  Pose keyMc;
  PointOdometryStatus status = PointOdometryStatus::starting;
};

constexpr double kHeldSigma = 1.0; // of a translation that was not seen, in units of the first baseline
// Prior on an unseen depth, in typical inverse depths. Wide: at twice the typical one it pulled far
// points nearer and the unit of length drifted by 40 % over pine-arc, at ten times by 2 %.
constexpr double kDepthPrior = 10;
constexpr double kRestSigma = 1e-2;
constexpr std::size_t kKeyFrames = 8;           // of the window
constexpr std::size_t kHeldKeyFrames = 3;       // oldest of them, not moved any more
constexpr double kKeyParallax = 1.2 * kDegree;  // median flow without rotation that makes a new key frame
constexpr double kKeyShared = 0.5;              // share of the last one's tracks below which a new one is made
constexpr double kStartParallax = 1 * kDegree;  // of the first baseline
constexpr double kStartDirection = 3 * kDegree; // standard deviation of its direction, at most
constexpr int kPlacingPoints = 12;              // of known depth that place a frame, at least
constexpr int kPlacingIterations = 6;           // of the bundle adjustment a frame
constexpr double kLeastNoise_px = 0.1;          // floor of the observation noise
} // namespace

struct PointOdometry::State
{
  PinholeCamera camera;
  double focal_sigma = 0; ///< of its log
  std::deque<KeyFrame> window;
  std::map<std::size_t, Pose> key_poses; ///< of all key frames, by frame index
  std::unordered_map<std::uint64_t, Landmark> landmarks;
  std::vector<Record> records;
  std::deque<Seen> since_first;       ///< before the start: what the last frames saw, none before the first key frame
  std::optional<GyroRotation> turned; ///< since the last key frame
  Pose wMc, velocity;                 ///< current pose, motion of the last frame
  Seen seen;
  double sigma = 1.5e-3;
  bool started = false;

  double focal() const { return std::sqrt(camera.fx * camera.fy); }
  PointOdometryResult begin(const PointTracker &tracker);
  void expectTurn(const std::vector<PointMatch> &matches);
  double unexplainedByTurning(const std::vector<PointMatch> &matches) const;
  std::vector<PointMatch> matchesWithFirst(const PointTracker &tracker) const;
  bool start(const RelativePoseEstimate &first);
  PointOdometryResult place(bool turned_known);
  void assemble(std::vector<BundleFrame> &frames, std::vector<BundlePoint> &points,
                std::vector<std::uint64_t> &ids) const;
  void disassemble(const std::vector<BundleFrame> &frames, const std::vector<BundlePoint> &points,
                   const std::vector<std::uint64_t> &ids);
  bool wantsKeyFrame() const;
  void addKeyFrame();
  void dropOldest();
  void addLandmarks();
  int known() const;
  double typicalInverseDepth() const;
};

PointOdometry::PointOdometry(const PinholeCamera &camera, double focal_sigma) : m_state(new State)
{
  m_state->camera = camera;
  m_state->focal_sigma = focal_sigma;
}
PointOdometry::~PointOdometry() = default;
PointOdometry::PointOdometry(PointOdometry &&) noexcept = default;
PointOdometry &PointOdometry::operator=(PointOdometry &&) noexcept = default;

PointOdometryResult PointOdometry::process(const PointTracker &tracker, const std::optional<GyroRotation> &turned)
{
  State &state = *m_state;
  const Pose before = state.wMc;
  state.seen.clear();
  for (const PointTrack &track : tracker.tracks())
    state.seen[track.id] = state.camera.ray(track.current()).head<2>();
  if (turned && (state.turned || state.records.empty() || state.window.back().frame + 1 == state.records.size()))
    state.turned = state.turned ? state.turned->then(*turned) : *turned;
  else
    state.turned.reset();
  state.records.emplace_back();
  if (turned)
    state.velocity.R = turned->R;
  else if (state.started)
    state.expectTurn(tracker.matches(1));
  PointOdometryResult result = state.started ? state.place(turned.has_value()) : state.begin(tracker);
  result.wMc = state.wMc;
  if (state.started && result.status == PointOdometryStatus::ok)
    state.velocity = before.inverse() * state.wMc;
  Record &last = state.records.back();
  last.status = result.status;
  if (state.started) {
    last.key = state.window.back().frame;
    last.keyMc = state.window.back().wMc.inverse() * state.wMc;
  }
  return result;
}

/// Before there is a unit of length: rotation against the first key frame, until the parallax is
/// enough.
PointOdometryResult PointOdometry::State::begin(const PointTracker &tracker)
{
  PointOdometryResult result;
  const std::size_t now = records.size() - 1;
  const auto restart = [&] {
    since_first.clear();
    window.clear();
    window.push_back({now, wMc, seen, std::nullopt});
    key_poses[now] = wMc;
    turned.reset();
    records[now].key = now;
    records[now].keyMc = Pose();
  };
  if (window.empty()) {
    restart();
    return result;
  }
  constexpr std::size_t kPlacedLater = 300; // frames that a start places: ten seconds of a video
  since_first.push_back(seen);
  if (since_first.size() > kPlacedLater)
    since_first.pop_front();
  const std::vector<PointMatch> matches = matchesWithFirst(tracker);
  RelativePosePrior prior;
  if (turned) {
    prior.aRb = turned->R;
    prior.rotation_covariance = turned->covariance();
  }
  const auto estimate = estimateRelativePose(matches, camera, prior);
  const double wanted_px = kStartParallax * focal();
  const bool translates =
      focal_sigma == 0 || unexplainedByTurning(matches) > std::max(0.25 * wanted_px, 3 * estimate.sigma_px);
  if ((!translates || !estimate.hasRotation()) && matches.size() >= 6) {
    // What looks like a flight past a wall is taken for a pan, and so is what cannot be told from one.
    wMc.R =
        window.front().wMc.R *
        motion::fitRotation(motion::Rays(matches, camera), motion::MotionPrior(prior), kLeastNoise_px / focal()).aRb;
  }
  else if (estimate.hasRotation()) {
    wMc.R = window.front().wMc.R * estimate.aRb;
  }
  records[now].key = window.front().frame;
  records[now].keyMc = window.front().wMc.inverse() * wMc;
  result.covariance.topLeftCorner<3, 3>() = kHeldSigma * kHeldSigma * Eigen::Matrix3d::Identity();
  result.covariance.bottomRightCorner<3, 3>() = estimate.covariance.topLeftCorner<3, 3>();
  result.sigma_px = estimate.sigma_px;
  const double direction_sigma = std::sqrt(std::max(estimate.covariance(3, 3), estimate.covariance(4, 4)));
  if (translates && estimate.hasDirection() && direction_sigma < kStartDirection && estimate.parallax_px > wanted_px &&
      start(estimate)) {
    result.status = PointOdometryStatus::ok;
    result.points = known();
    return result;
  }
  // Too little is left of what the first key frame saw: go on from here.
  if (matches.size() < std::max<std::size_t>(2 * RelativePoseEstimate::kLeastMatches, 30))
    restart();
  return result;
}

/// Predicts a turn that the last motion does not announce: started too far off, the robust adjustment would take all
/// points for outliers.
void PointOdometry::State::expectTurn(const std::vector<PointMatch> &matches)
{
  constexpr double kSurprise = 2 * kDegree;
  if (matches.size() < RelativePoseEstimate::kLeastMatches)
    return;
  const Eigen::Matrix3d turn =
      motion::fitRotation(motion::Rays(matches, camera), motion::MotionPrior({}), kLeastNoise_px / focal()).aRb;
  if (logSo3(velocity.R.transpose() * turn).norm() > kSurprise)
    velocity.R = turn;
}

/// Flow [px] of the bulk of the matches that a rotation leaves, at the focal length that leaves
/// least.
double PointOdometry::State::unexplainedByTurning(const std::vector<PointMatch> &matches) const
{
  double least = 1e9;
  for (int sigmas = -3; sigmas <= 3; ++sigmas) {
    const double factor = std::exp(sigmas * focal_sigma);
    const double pixel = 1 / (factor * focal());
    const auto fit = motion::fitRotation(motion::Rays(matches, motion::withFocal(camera, factor)),
                                         motion::MotionPrior({}), 0.05 * pixel);
    least = std::min(least, fit.sigma / pixel);
  }
  return least;
}

/// Points of the first key frame that are still followed, however long ago it was.
std::vector<PointMatch> PointOdometry::State::matchesWithFirst(const PointTracker &tracker) const
{
  std::vector<PointMatch> matches;
  const Seen &first = window.front().seen;
  for (const PointTrack &track : tracker.tracks())
    if (const auto found = first.find(track.id); found != first.end())
      matches.push_back({camera.project(found->second.homogeneous()), track.current()});
  return matches;
}

bool PointOdometry::State::start(const RelativePoseEstimate &first)
{
  const KeyFrame &origin = window.front();
  wMc = origin.wMc * Pose(first.aRb, first.direction);
  landmarks.clear();
  // Inverse depths from the two frames, then both and the frames between in one adjustment.
  std::vector<BundleFrame> pair(2);
  pair[0].wMc = origin.wMc;
  pair[0].fixed = true;
  pair[1].wMc = wMc;
  for (const auto &[id, xy_a] : origin.seen) {
    const auto found = seen.find(id);
    if (found == seen.end())
      continue;
    BundlePoint point;
    point.xy = xy_a;
    point.seen.push_back({1, found->second, 1});
    motion::triangulate(point, pair);
    landmarks[id] = {origin.frame, xy_a, point.inverse_depth, 0, 0};
  }
  const std::size_t now = records.size() - 1;
  window.push_back({now, wMc, seen, turned});
  key_poses[now] = wMc;
  turned.reset();
  started = true;
  std::vector<BundleFrame> frames;
  std::vector<BundlePoint> points;
  std::vector<std::uint64_t> ids;
  assemble(frames, points, ids);
  BundleOptions bundle;
  bundle.iterations = 20;
  bundle.sigma = std::max(sigma, 1.5 * first.sigma_px / focal());
  bundle.min_sigma = kLeastNoise_px / focal();
  bundle.first_baseline = 1;
  const BundleResult solved = motion::solveBundle(frames, points, bundle);
  if (!solved.solved) {
    window.pop_back();
    started = false;
    return false;
  }
  sigma = solved.sigma;
  disassemble(frames, points, ids);
  wMc = window.back().wMc;
  key_poses[now] = wMc;
  // The frames between, each placed on its own against the points.
  const auto since_origin = static_cast<double>(now - origin.frame);
  for (std::size_t k = 0; k + 1 < since_first.size(); ++k) {
    const std::size_t frame = now + 1 - since_first.size() + k;
    const double along = static_cast<double>(frame - origin.frame) / since_origin;
    const Pose step = origin.wMc.inverse() * wMc;
    pair[1].wMc = origin.wMc * Pose(expSo3(along * logSo3(step.R)), along * step.t);
    std::vector<BundlePoint> seen_between;
    for (const auto &[id, landmark] : landmarks) {
      const auto found = since_first[k].find(id);
      if (found == since_first[k].end())
        continue;
      BundlePoint point;
      point.xy = landmark.xy;
      point.inverse_depth = point.prior = landmark.inverse_depth;
      point.prior_information = 1e8;
      point.seen.push_back({1, found->second, 1});
      seen_between.push_back(point);
    }
    bundle.first_baseline.reset();
    if (seen_between.size() >= 6 && motion::solveBundle(pair, seen_between, bundle).solved) {
      Record &record = records[frame];
      record.key = origin.frame;
      record.keyMc = origin.wMc.inverse() * pair[1].wMc;
      record.status = PointOdometryStatus::ok;
    }
  }
  addLandmarks();
  velocity = Pose(expSo3(logSo3(first.aRb) / since_origin), first.direction / since_origin);
  since_first.clear();
  return true;
}

void PointOdometry::State::assemble(std::vector<BundleFrame> &frames, std::vector<BundlePoint> &points,
                                    std::vector<std::uint64_t> &ids) const
{
  const auto addFrame = [&frames](const Pose &pose, const std::optional<GyroRotation> &since_before) {
    BundleFrame frame;
    frame.wMc = pose;
    if (since_before && !frames.empty()) {
      frame.previousRthis = since_before->R;
      frame.rotation_information = since_before->covariance().inverse();
    }
    frames.push_back(frame);
  };
  std::map<std::size_t, std::size_t> index;
  const std::size_t held = window.size() <= 3 ? 1 : std::min(kHeldKeyFrames, window.size() - 2);
  for (const KeyFrame &key : window) {
    index[key.frame] = frames.size();
    addFrame(key.wMc, key.turned);
    frames.back().fixed = frames.size() <= held;
  }
  const bool current = window.back().frame + 1 != records.size();
  if (current)
    addFrame(wMc, turned);
  const double typical = typicalInverseDepth();
  for (const auto &[id, landmark] : landmarks) {
    BundlePoint point;
    point.anchor = index.at(landmark.anchor);
    point.xy = landmark.xy;
    point.inverse_depth = landmark.inverse_depth;
    point.prior = typical;
    point.prior_information = 1 / (kDepthPrior * kDepthPrior * typical * typical + kRestSigma * kRestSigma);
    for (std::size_t k = 0; k < window.size(); ++k) {
      const auto found = window[k].seen.find(id);
      if (k != point.anchor && found != window[k].seen.end())
        point.seen.push_back({k, found->second, 1});
    }
    const auto found = seen.find(id);
    if (current && found != seen.end())
      point.seen.push_back({frames.size() - 1, found->second, 1});
    if (!point.seen.empty()) {
      points.push_back(point);
      ids.push_back(id);
    }
  }
}

void PointOdometry::State::disassemble(const std::vector<BundleFrame> &frames, const std::vector<BundlePoint> &points,
                                       const std::vector<std::uint64_t> &ids)
{
  for (std::size_t k = 0; k < window.size(); ++k) {
    window[k].wMc = frames[k].wMc;
    key_poses[window[k].frame] = frames[k].wMc;
  }
  if (frames.size() > window.size())
    wMc = frames.back().wMc;
  for (std::size_t k = 0; k < points.size(); ++k) {
    Landmark &landmark = landmarks[ids[k]];
    landmark.inverse_depth = points[k].inverse_depth;
    landmark.information = points[k].information;
    double good = 0;
    for (const auto &observation : points[k].seen)
      good += observation.weight > 0.4;
    const bool bad =
        good < 0.5 * double(points[k].seen.size()) || points[k].inverse_depth * std::sqrt(points[k].information) < -4;
    landmark.misses = bad ? landmark.misses + 1 : 0;
  }
  for (auto landmark = landmarks.begin(); landmark != landmarks.end();)
    landmark = landmark->second.misses > 2 ? landmarks.erase(landmark) : std::next(landmark);
}

PointOdometryResult PointOdometry::State::place(bool turned_known)
{
  PointOdometryResult result;
  wMc = wMc * velocity;
  int common = 0;
  for (const auto &[id, landmark] : landmarks)
    common += seen.count(id) > 0;
  result.points = known();
  if (common < kPlacingPoints) {
    // No point of known depth is left: the map ends here and a new one begins, whose unit comes from the last velocity.
    result.status = PointOdometryStatus::lost;
    result.covariance.diagonal() << Eigen::Vector3d::Constant(kHeldSigma * kHeldSigma),
        Eigen::Vector3d::Constant(turned_known ? 1e-6 : 1e-2);
    addKeyFrame();
    return result;
  }
  std::vector<BundleFrame> frames;
  std::vector<BundlePoint> points;
  std::vector<std::uint64_t> ids;
  assemble(frames, points, ids);
  BundleOptions bundle;
  bundle.iterations = kPlacingIterations;
  bundle.sigma = sigma;
  bundle.min_sigma = kLeastNoise_px / focal();
  if (window.size() <= 3)
    bundle.first_baseline = (window[1].wMc.t - window[0].wMc.t).norm();
  const BundleResult solved = motion::solveBundle(frames, points, bundle);
  result.sigma_px = solved.sigma * focal();
  if (solved.solved && solved.inliers > 0.3) {
    sigma = 0.9 * sigma + 0.1 * solved.sigma;
    disassemble(frames, points, ids);
    result.points = known();
    result.status = result.points >= kPlacingPoints ? PointOdometryStatus::ok : PointOdometryStatus::rotation_only;
    result.covariance = motion::kInflation * solved.last_covariance;
    if (result.status == PointOdometryStatus::rotation_only)
      result.covariance.topLeftCorner<3, 3>() += kHeldSigma * kHeldSigma * Eigen::Matrix3d::Identity();
  }
  else {
    result.status = PointOdometryStatus::lost;
  }
  if (wantsKeyFrame())
    addKeyFrame();
  return result;
}

bool PointOdometry::State::wantsKeyFrame() const
{
  const KeyFrame &key = window.back();
  const Eigen::Matrix3d keyRc = key.wMc.R.transpose() * wMc.R;
  std::vector<double> flow;
  for (const auto &[id, xy] : key.seen) {
    const auto found = seen.find(id);
    if (found != seen.end()) {
      const Eigen::Vector3d turned_ray = keyRc * found->second.homogeneous();
      flow.push_back((xy - turned_ray.head<2>() / std::max(0.1, turned_ray.z())).norm());
    }
  }
  return double(flow.size()) < kKeyShared * double(key.seen.size()) || medianOf(flow) > kKeyParallax;
}

void PointOdometry::State::addKeyFrame()
{
  const std::size_t now = records.size() - 1;
  window.push_back({now, wMc, seen, turned});
  key_poses[now] = wMc;
  turned.reset();
  if (window.size() > kKeyFrames)
    dropOldest();
  addLandmarks();
}

/// Points anchored in the frame that leaves move to the next frame of the window that saw them.
void PointOdometry::State::dropOldest()
{
  const KeyFrame oldest = window.front();
  window.pop_front();
  for (auto it = landmarks.begin(); it != landmarks.end();) {
    Landmark &landmark = it->second;
    if (landmark.anchor != oldest.frame) {
      ++it;
      continue;
    }
    const auto next = std::find_if(window.begin(), window.end(),
                                   [id = it->first](const KeyFrame &key) { return key.seen.count(id) > 0; });
    if (next == window.end()) {
      it = landmarks.erase(it);
      continue;
    }
    const Eigen::Vector3d y = next->wMc.R.transpose() * (oldest.wMc.R * landmark.xy.homogeneous() +
                                                         landmark.inverse_depth * (oldest.wMc.t - next->wMc.t));
    if (y.z() < 0.05) {
      it = landmarks.erase(it);
      continue;
    }
    landmark.anchor = next->frame;
    landmark.xy = next->seen.at(it->first);
    landmark.inverse_depth /= y.z();
    ++it;
  }
}

void PointOdometry::State::addLandmarks()
{
  const double typical = typicalInverseDepth();
  for (const auto &[id, xy] : window.back().seen)
    if (landmarks.count(id) == 0)
      landmarks[id] = {window.back().frame, xy, typical, 0, 0};
}

int PointOdometry::State::known() const
{
  int n = 0;
  for (const auto &[id, landmark] : landmarks)
    n += seen.count(id) > 0 && landmark.information > 0 && landmark.inverse_depth * std::sqrt(landmark.information) > 4;
  return n;
}

double PointOdometry::State::typicalInverseDepth() const
{
  std::vector<double> depths;
  for (const auto &[id, landmark] : landmarks)
    if (landmark.information > 0 && landmark.inverse_depth * std::sqrt(landmark.information) > 3)
      depths.push_back(landmark.inverse_depth);
  return depths.size() < 5 ? 0.05 : medianOf(depths);
}

std::vector<PlacedFrame> PointOdometry::trajectory() const
{
  std::vector<PlacedFrame> placed;
  placed.reserve(m_state->records.size());
  for (const Record &record : m_state->records) {
    const auto key = m_state->key_poses.find(record.key);
    const Pose wMk = key == m_state->key_poses.end() ? Pose() : key->second;
    placed.push_back({wMk * record.keyMc, record.status});
  }
  return placed;
}

std::vector<PointDepth> PointOdometry::depths() const
{
  constexpr double kMostRelativeSigma = 0.3;
  std::vector<PointDepth> depths;
  for (const auto &[id, landmark] : m_state->landmarks) {
    const auto seen = m_state->seen.find(id);
    const auto anchor = m_state->key_poses.find(landmark.anchor);
    if (seen == m_state->seen.end() || anchor == m_state->key_poses.end() || landmark.information <= 0)
      continue;
    const Pose cMa = m_state->wMc.inverse() * anchor->second;
    const Eigen::Vector3d y = cMa.R * landmark.xy.homogeneous() + landmark.inverse_depth * cMa.t;
    if (y.z() < 0.05)
      continue;
    const double sigma = 1 / std::sqrt(landmark.information) / y.z();
    const double inverse_depth = landmark.inverse_depth / y.z();
    if (sigma < kMostRelativeSigma * inverse_depth || std::abs(inverse_depth) < sigma)
      depths.push_back({m_state->camera.project(seen->second.homogeneous()), inverse_depth, sigma, id});
  }
  std::sort(depths.begin(), depths.end(), [](const PointDepth &x, const PointDepth &y) { return x.id < y.id; });
  return depths;
}
} // namespace bole
