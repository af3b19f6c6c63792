// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/focal_length.h"

#include "geometry/median.h"
#include "motion/epipolar.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
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
constexpr double kMostSigma = 0.1; // of what is called known
constexpr double kLeast_px = 0.05; // residual that a tracker can tell from none

// Turns are looked for between a frame and the eighth before it, which moved by this share of the image's width
constexpr int kTurnFrames = 8;
constexpr double kTurnFlow = 0.04;
// and are some when a rotation leaves this share of the flow: a real video that pans leaves 0.01, flights through trees
// 0.02 to 0.1.
constexpr double kTurnResidual = 0.025;
constexpr std::size_t kTurnMatches = 25;

double logFactor(double step) { return kShortest + kStep * step; }

PinholeCamera withFocal(PinholeCamera camera, double factor)
{
  camera.fx *= factor;
  camera.fy *= factor;
  return camera;
}

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
  Eigen::MatrixXd A(last - first + 1, 3);
  for (int k = first; k <= last; ++k)
    A.row(k - first) << 1, k - best, (k - best) * (k - best);
  const Eigen::Vector3d c = A.colPivHouseholderQr().solve(sum.segment(first, last - first + 1));
  const double vertex = -0.5 * c[1] / c[2];
  if (c[2] <= 0 || vertex < first - best || vertex > last - best)
    return std::nullopt;
  return logFactor(best + vertex);
}
} // namespace

FocalFinder::FocalFinder(const PinholeCamera &guess) : m_guess(guess)
{
  for (int k = 0; k < kSteps; ++k)
    m_odometry.emplace_back(withFocal(guess, std::exp(logFactor(k))), false);
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
    const PinholeCamera camera = withFocal(m_guess, std::exp(logFactor(k)));
    const auto turn = motion::fitRotation(motion::Rays(matches, camera), motion::MotionPrior({}), kLeast_px / camera.fx,
                                          RelativePoseOptions());
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
  return estimate;
}
} // namespace bole
