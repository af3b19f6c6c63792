// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/focal_length.h"

#include "geometry/median.h"
#include "motion/bundle.h"
#include "motion/epipolar.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace bole
{
namespace
{
constexpr int kSteps = 21;
constexpr double kStep = 0.1;      // of the log of the factor: residuals change little between two of them
constexpr double kShortest = -0.8; // log of the smallest factor: fewer lenses are wider than the guess than narrower
constexpr int kNear = 3;           // steps on both sides of the least cost, which a parabola is laid through
constexpr std::size_t kParts = 5;  // of a video, to see how well they agree
constexpr std::size_t kLeastFrames = 20; // four a part
// What every part of a video has in common: the model of a lens without distortion, points that slide. Over 39 flights
// and videos the error was .037.
constexpr double kModelSigma = 0.03;
constexpr double kMostSigma = 0.1;  // of what is called known
constexpr double kLensSigma = 0.01; // of the model of a lens without distortion
constexpr double kLeast_px = 0.05;  // residual that a tracker can tell from none

// Turns are looked for between a frame and the eighth before it, which moved by this share of the image's width
constexpr int kTurnFrames = 8;
constexpr double kTurnFlow = 0.04;
// and are some when a rotation leaves this share of the flow: a real video that pans leaves 0.01, flights through trees
// 0.02 to 0.1.
constexpr double kTurnResidual = 0.025;
constexpr std::size_t kTurnMatches = 25;

double logFactor(double step) { return kShortest + kStep * step; }

/// Cost of a frame by focal length: the log of the residual [px] for each point that is explained. Empty where the
/// frame cannot tell: no start yet under most of them, or lost.
std::vector<double> costsOf(const std::vector<PointOdometryResult> &placed)
{
  std::vector<double> costs;
  double worst = -HUGE_VAL;
  int good = 0;
  for (const PointOdometryResult &one : placed) {
    const bool is_good = one.status == PointOdometryStatus::ok && one.points > 0;
    costs.push_back(is_good ? std::log(std::max(one.sigma_px, kLeast_px) / one.points) : HUGE_VAL);
    worst = is_good ? std::max(worst, costs.back()) : worst;
    good += is_good;
  }
  if (2 * good < kSteps)
    return {};
  for (double &cost : costs)
    cost = std::min(cost, worst);
  return costs;
}

/// Where the sum of the costs has its minimum, one part of the video left out (kParts: none); nothing when it lies at
/// the end of the range or nowhere.
std::optional<double> bestLogFactor(const std::vector<std::vector<double>> &costs, std::size_t left_out)
{
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(kSteps);
  for (std::size_t i = 0; i < costs.size(); ++i)
    if (i * kParts / costs.size() != left_out)
      sum += Eigen::Map<const Eigen::VectorXd>(costs[i].data(), kSteps);
  int best = 0;
  sum.minCoeff(&best);
  if (best == 0 || best + 1 == kSteps)
    return std::nullopt;
  const int first = std::max(0, best - kNear), last = std::min(kSteps - 1, best + kNear);
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (int k = first; k <= last; ++k) {
    const Eigen::Vector3d powers(1, k - best, (k - best) * (k - best));
    A += powers * powers.transpose();
    b += sum[k] * powers;
  }
  const Eigen::Vector3d c = A.ldlt().solve(b);
  const double vertex = -0.5 * c[1] / c[2];
  if (c[2] <= 0 || vertex < first - best || vertex > last - best)
    return std::nullopt;
  return logFactor(best + vertex);
}
} // namespace

FocalFinder::FocalFinder(const PinholeCamera &guess) : m_guess(guess)
{
  for (int k = 0; k < kSteps; ++k)
    m_odometry.emplace_back(motion::withFocal(guess, std::exp(logFactor(k))), kGuessedFocalSigma);
}

void FocalFinder::add(const PointTracker &tracker)
{
  std::vector<PointOdometryResult> placed;
  for (PointOdometry &odometry : m_odometry)
    placed.push_back(odometry.process(tracker));
  std::vector<double> costs = costsOf(placed);
  if (!costs.empty())
    m_flown.push_back(std::move(costs));
  addTurn(tracker);
  m_seen.emplace_back();
  for (const PointTrack &track : tracker.tracks())
    m_seen.back().emplace_back(track.id, m_guess.ray(track.current()).head<2>());
}

void FocalFinder::addTurn(const PointTracker &tracker)
{
  const std::vector<PointMatch> matches = tracker.matches(kTurnFrames);
  if (matches.size() < kTurnMatches)
    return;
  std::vector<double> flows;
  for (const PointMatch &match : matches)
    flows.push_back((match.b_px - match.a_px).norm());
  const double flow_px = medianOf(std::move(flows));
  if (flow_px < kTurnFlow * m_guess.width)
    return;
  ++m_moved;
  std::vector<double> costs;
  for (int k = 0; k < kSteps; ++k) {
    const PinholeCamera camera = motion::withFocal(m_guess, std::exp(logFactor(k)));
    const auto turn =
        motion::fitRotation(motion::Rays(matches, camera), motion::MotionPrior({}), kLeast_px / camera.fx);
    costs.push_back(std::log(turn.sigma * camera.fx));
  }
  if (*std::min_element(costs.begin(), costs.end()) < std::log(kTurnResidual * flow_px))
    m_turned.push_back(std::move(costs));
}

FocalEstimate FocalFinder::estimate() const
{
  FocalEstimate estimate;
  const bool only_turns = !m_turned.empty() && 2 * m_turned.size() >= static_cast<std::size_t>(m_moved);
  const Costs &costs = only_turns ? m_turned : m_flown;
  const std::optional<double> best = bestLogFactor(costs, kParts);
  if (!best || costs.size() < kLeastFrames)
    return estimate;
  // how far it moves when one part of the video is left out (jackknife)
  double squares = 0;
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::optional<double> without = bestLogFactor(costs, part);
    if (!without)
      return estimate;
    squares += (*without - *best) * (*without - *best);
  }
  estimate.factor = std::exp(*best);
  estimate.sigma = std::hypot(std::sqrt(squares * (kParts - 1) / kParts), kModelSigma);
  estimate.known = estimate.sigma < kMostSigma;
  if (!only_turns && estimate.known)
    if (const FocalEstimate exact = adjusted(*best); exact.known && exact.sigma < estimate.sigma)
      return exact;
  return estimate;
}

/// By bundle adjustment of the whole video, from the path under the focal length of the grid next to \p log_factor.
FocalEstimate FocalFinder::adjusted(double log_factor) const
{
  constexpr std::size_t kMostFrames = 40;
  constexpr std::size_t kLeastSeen = 4; // frames that see a point: fewer hardly hold a focal length
  constexpr double kInflation = 3; // of the standard deviation: errors of one track in its frames are alike. Over nine
                                   // videos the error was 2.9 of what independent ones would give
  const int grid = std::clamp(static_cast<int>(std::lround((log_factor - kShortest) / kStep)), 0, kSteps - 1);
  const double scale = std::exp(-logFactor(grid));
  const std::vector<PlacedFrame> path = m_odometry[static_cast<std::size_t>(grid)].trajectory();
  std::vector<std::size_t> placed;
  for (std::size_t i = 0; i < path.size(); ++i)
    if (path[i].status == PointOdometryStatus::ok)
      placed.push_back(i);
  FocalEstimate estimate;
  if (placed.size() < kLeastFrames)
    return estimate;
  std::vector<motion::BundleFrame> frames;
  std::map<std::uint64_t, motion::BundlePoint> tracks;
  const std::size_t count = std::min(kMostFrames, placed.size());
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t frame = placed[k * (placed.size() - 1) / (count - 1)];
    frames.emplace_back();
    frames.back().wMc = path[frame].wMc;
    frames.back().fixed = k == 0;
    for (const auto &[id, xy] : m_seen[frame]) {
      const auto [track, is_new] = tracks.try_emplace(id);
      if (is_new) {
        track->second.anchor = k;
        track->second.xy = scale * xy;
      }
      else
        track->second.seen.push_back({k, scale * xy, 1});
    }
  }
  std::vector<motion::BundlePoint> points;
  for (auto &[id, point] : tracks)
    if (point.seen.size() + 1 >= kLeastSeen) {
      motion::triangulate(point, frames);
      points.push_back(std::move(point));
    }
  const double pixel = scale / m_guess.fx;
  motion::BundleOptions options;
  options.iterations = 40;
  options.settled = 1e-5;
  options.with_focal = true;
  options.first_baseline = (frames[1].wMc.t - frames[0].wMc.t).norm();
  options.min_sigma = kLeast_px * pixel;
  options.sigma = 0.3 * pixel;
  motion::BundleResult solved;
  for (int round = 0; round < 2; ++round) { // the second knows how the points scatter
    solved = motion::solveBundle(frames, points, options);
    options.sigma = solved.sigma;
    options.log_focal = solved.log_focal;
  }
  estimate.factor = std::exp(logFactor(grid) + solved.log_focal);
  estimate.sigma = std::hypot(kInflation * solved.focal_sigma, kLensSigma);
  estimate.known = solved.solved && estimate.sigma < kMostSigma;
  return estimate;
}
} // namespace bole
