// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/ground_plane.h"

#include "geometry/constants.h"
#include "geometry/median.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
struct Height
{
  double value, variance;
};

double weightedMean(const std::vector<Height> &heights, double centre, double gate, double roughness2, double &variance,
                    int &used)
{
  double sum = 0, weights = 0;
  used = 0;
  for (const Height &h : heights) {
    const double total = h.variance + roughness2;
    const double u2 = (h.value - centre) * (h.value - centre) / total;
    if (u2 < gate * gate) {
      sum += h.value / total;
      weights += 1 / total;
      ++used;
    }
  }
  variance = weights > 0 ? 1 / weights : 0;
  return weights > 0 ? sum / weights : centre;
}
} // namespace

GroundHeight heightOverGround(const std::vector<PointDepth> &points, const PinholeCamera &camera,
                              const Eigen::Vector3d &up)
{
  constexpr double kMinDepression = 8 * kDegree; // below the horizon: nearer to it heights are noise
  constexpr double kUpSigma = 1 * kDegree;       // of the direction of up
  constexpr double kMaxRelativeSigma = 0.15;     // of a point's depth
  constexpr double kRoughness = 0.06;            // of the ground, in heights of the camera: bumps
  constexpr int kMinPoints = 8;
  GroundHeight ground;
  std::vector<Height> heights;
  const double sine = std::sin(kMinDepression);
  for (const PointDepth &point : points) {
    const Eigen::Vector3d ray = camera.ray(point.pixel);
    const double below = -up.dot(ray);
    if (below < sine * ray.norm() || point.inverse_depth <= 0 || point.sigma > kMaxRelativeSigma * point.inverse_depth)
      continue;
    const double h = below / point.inverse_depth;
    const double relative = point.sigma / point.inverse_depth;
    const double tilt = kUpSigma * ray.norm() / below; // moves the horizon
    heights.push_back({h, h * h * (relative * relative + tilt * tilt)});
  }
  if (heights.size() < static_cast<std::size_t>(kMinPoints))
    return ground;
  // Bushes and trunks stand above the ground at all heights: the height with the most support wins.
  double best_support = 0, centre = 0;
  for (const Height &candidate : heights) {
    const double roughness = kRoughness * candidate.value;
    double support = 0;
    for (const Height &h : heights) {
      const double u2 =
          (h.value - candidate.value) * (h.value - candidate.value) / (h.variance + roughness * roughness);
      support += std::exp(-0.5 * u2);
    }
    if (support > best_support) {
      best_support = support;
      centre = candidate.value;
    }
  }
  double variance = 0;
  int used = 0; // on the ground
  for (int round = 0; round < 4; ++round) {
    const double roughness = kRoughness * centre;
    centre = weightedMean(heights, centre, 2, roughness * roughness, variance, used);
  }
  ground.known = used >= kMinPoints;
  ground.height = centre;
  // Neighbouring points share a bump: four of them count as one.
  ground.sigma = 2 * std::sqrt(variance);
  return ground;
}

void ScaleFromHeight::add(const GroundHeight &seen, double height_m, double sigma_m)
{
  if (!seen.known || !(height_m > 0) || !(seen.height > 0))
    return;
  const double relative_seen = seen.sigma / seen.height, relative_m = sigma_m / height_m;
  m_logs.push_back(std::log(height_m / seen.height));
  m_variances.push_back(relative_seen * relative_seen + relative_m * relative_m + 1e-6);
}

double ScaleFromHeight::metresPerUnit() const
{
  if (m_logs.empty())
    return 1;
  double centre = medianOf(m_logs);
  for (int round = 0; round < 5; ++round) {
    double sum = 0, weights = 0;
    for (std::size_t i = 0; i < m_logs.size(); ++i) {
      const double off = m_logs[i] - centre;
      const double w = 1 / (m_variances[i] + off * off);
      sum += w * m_logs[i];
      weights += w;
    }
    centre = sum / weights;
  }
  return std::exp(centre);
}

double ScaleFromHeight::relativeSigma() const
{
  double weights = 0, spread = 0;
  const double centre = std::log(metresPerUnit());
  for (std::size_t i = 0; i < m_logs.size(); ++i) {
    weights += 1 / m_variances[i];
    spread += (m_logs[i] - centre) * (m_logs[i] - centre) / m_variances[i];
  }
  if (m_logs.empty())
    return 1;
  const double excess = std::max(1.0, spread / double(m_logs.size()));
  constexpr double kShared = 0.07;
  return std::sqrt(std::min<double>(10, double(m_logs.size())) * excess / weights + kShared * kShared);
}
} // namespace bole
