// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/focal_length.h"

#include "geometry/require_range.h"

#include "geometry/median.h"

#include "motion/epipolar.h"
#include <algorithm>
#include <cmath>
#include <optional>

namespace bole
{
namespace
{
constexpr double kRange = 1.5, kStep = 0.1; // of the log of the factor
constexpr int kSteps = 31;

double logFactor(double step) { return -kRange + kStep * step; }

double medianFlow_px(const std::vector<PointMatch> &matches)
{
  std::vector<double> flow;
  for (const PointMatch &match : matches)
    flow.push_back((match.b_px - match.a_px).norm());
  return medianOf(flow);
}

/// Residual [px of the guess] that the best rotation leaves when the focal length is exp(log_factor) times the guess.
double residual_px(const std::vector<PointMatch> &matches, const PinholeCamera &guess, double log_factor)
{
  PinholeCamera camera = guess;
  camera.fx *= std::exp(log_factor);
  camera.fy *= std::exp(log_factor);
  constexpr double kLeast_px = 0.05;
  const double sigma = motion::fitRotation(motion::Rays(matches, camera), motion::MotionPrior({}),
                                           kLeast_px / camera.fx, RelativePoseOptions())
                           .sigma;
  return sigma * camera.fx;
}

constexpr std::size_t kParts = 5; ///< of a video, to see how well they agree

/// Where the sum of the curves has its minimum, one part of the video left out (kParts: none); nothing when it lies at
/// the end of the range.
std::optional<double> bestLogFactor(const std::vector<std::vector<double>> &curves, std::size_t left_out)
{
  std::vector<double> sum(kSteps, 0.0);
  for (std::size_t i = 0; i < curves.size(); ++i)
    if (i * kParts / curves.size() != left_out)
      for (int k = 0; k < kSteps; ++k)
        sum[static_cast<std::size_t>(k)] += curves[i][static_cast<std::size_t>(k)];
  const auto best = std::min_element(sum.begin(), sum.end());
  if (best == sum.begin() || best + 1 == sum.end())
    return std::nullopt;
  const double before = *(best - 1), after = *(best + 1), curvature = before - 2 * *best + after;
  const double vertex = curvature > 0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0;
  return logFactor(static_cast<double>(best - sum.begin()) + vertex);
}
} // namespace

FocalFromTurning::FocalFromTurning(const PinholeCamera &guess, const FocalOptions &options)
    : m_guess(guess), m_options(options)
{
  requireRange("frames_back", options.frames_back, 1, 31);
  requireRange("every", options.every, 1, 100);
  requireRange("min_flow", options.min_flow, 0.005, 1);
  requireRange("max_residual", options.max_residual, 0.001, 1);
  requireRange("min_pairs", options.min_pairs, 2, 1000);
  requireRange("max_sigma", options.max_sigma, 0.01, 1);
}

void FocalFromTurning::add(const PointTracker &tracker)
{
  constexpr std::size_t kLeastMatches = 25;
  if (++m_frames % m_options.every != 0)
    return;
  const std::vector<PointMatch> matches = tracker.matches(m_options.frames_back);
  if (matches.size() < kLeastMatches)
    return;
  const double flow = medianFlow_px(matches);
  if (flow < m_options.min_flow * m_guess.width)
    return;
  ++m_moved;
  std::vector<double> curve;
  for (int i = 0; i < kSteps; ++i)
    curve.push_back(residual_px(matches, m_guess, logFactor(i)));
  if (*std::min_element(curve.begin(), curve.end()) > m_options.max_residual * flow)
    return;
  for (double &residual : curve)
    residual = std::log(residual);
  m_curves.push_back(std::move(curve));
}

FocalEstimate FocalFromTurning::estimate() const
{
  FocalEstimate estimate;
  estimate.pairs = static_cast<int>(m_curves.size());
  if (estimate.pairs < m_options.min_pairs || 2 * estimate.pairs < m_moved)
    return estimate;
  const std::optional<double> best = bestLogFactor(m_curves, kParts);
  if (!best)
    return estimate;
  // how far it moves when one part of the video is left out
  double squares = 0;
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::optional<double> without = bestLogFactor(m_curves, part);
    if (!without)
      return estimate;
    squares += (*without - *best) * (*without - *best);
  }
  estimate.factor = std::exp(*best);
  estimate.sigma = std::max(0.01, std::sqrt(squares * (kParts - 1) / kParts));
  estimate.known = estimate.sigma < m_options.max_sigma;
  return estimate;
}
} // namespace bole
