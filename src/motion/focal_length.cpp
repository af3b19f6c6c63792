// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/motion/focal_length.h>

#include "epipolar.h"
#include "require.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kRange = 1.5, kStep = 0.1; // of the log of the factor

double medianOf(std::vector<double> values)
{
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

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
  const double sigma = motion::fitRotation(motion::Rays(matches, camera), motion::MotionPrior({}), kLeast_px / camera.fx,
                                           RelativePoseOptions())
                           .sigma;
  return sigma * camera.fx;
}
} // namespace

void FocalOptions::validate() const
{
  using motion::require;
  require(frames_back >= 1 && frames_back <= 31, "focal.frames_back", frames_back, "in 1 .. 31");
  require(every >= 1 && every <= 100, "focal.every", every, "in 1 .. 100");
  require(min_flow >= 0.005 && min_flow <= 1, "focal.min_flow", min_flow, "in 0.005 .. 1");
  require(max_residual >= 0.001 && max_residual <= 1, "focal.max_residual", max_residual, "in 0.001 .. 1");
  require(min_pairs >= 2 && min_pairs <= 1000, "focal.min_pairs", min_pairs, "in 2 .. 1000");
  require(max_spread >= 0.01 && max_spread <= 1, "focal.max_spread", max_spread, "in 0.01 .. 1");
}

FocalFromTurning::FocalFromTurning(const PinholeCamera &guess, const FocalOptions &options)
    : m_guess(guess), m_options(options)
{
  m_options.validate();
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
  std::vector<double> residuals;
  for (double x = -kRange; x < kRange + 0.5 * kStep; x += kStep)
    residuals.push_back(residual_px(matches, m_guess, x));
  const auto best = std::min_element(residuals.begin(), residuals.end());
  if (best == residuals.begin() || best + 1 == residuals.end() || *best > m_options.max_residual * flow)
    return;
  const double before = *(best - 1), after = *(best + 1), curvature = before - 2 * *best + after;
  const double vertex = curvature > 0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0;
  m_log_factors.push_back(-kRange + kStep * (static_cast<double>(best - residuals.begin()) + vertex));
}

FocalEstimate FocalFromTurning::estimate() const
{
  FocalEstimate estimate;
  estimate.pairs = static_cast<int>(m_log_factors.size());
  if (estimate.pairs < m_options.min_pairs)
    return estimate;
  const double centre = medianOf(m_log_factors);
  std::vector<double> off;
  for (const double x : m_log_factors)
    off.push_back(std::abs(x - centre));
  const double spread = 1.48 * medianOf(off);
  // pairs share frames: those of frames_back frames count as one
  const double independent = std::max(1.0, double(estimate.pairs) * m_options.every / m_options.frames_back);
  estimate.factor = std::exp(centre);
  estimate.sigma = std::max(0.01, spread / std::sqrt(independent));
  estimate.known = spread < m_options.max_spread;
  return estimate;
}
} // namespace bole
