// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/forest.h"

#include "simulation/random.h"
#include "support/text.h"

#include <bole/trunk_record.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace bole
{
namespace
{
constexpr double kFarRadius = 70;     ///< of the scenery [m]: beyond, haze and the size of a pixel hide a trunk
constexpr double kFarDensity = 0.018; ///< at most, trunks a m^2: seen edge on it is already a wall
constexpr double kSpacing = 0.8;      ///< between two trunks [m]

enum Stream : std::uint64_t
{
  kTerrain = 1,
  kSun,
  kNear,
  kFar,
  kBushes,
  kSaplings
};

double distanceToPath(const Eigen::Vector2d &p, const std::vector<Eigen::Vector3d> &path)
{
  double best = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d &q : path)
    best = std::min(best, (q.head<2>() - p).squaredNorm());
  return std::sqrt(best);
}

SimulatedTrunk grow(Random &random, const ForestOptions &options)
{
  SimulatedTrunk trunk;
  trunk.radius = options.radius_median * std::clamp(std::exp(options.radius_spread * random.normal()), 0.4, 3.0);
  const double lean = std::tan(options.lean_deg * M_PI / 180);
  trunk.lean = {lean * random.normal(), lean * random.normal()};
  trunk.bow = {options.bow * random.normal(), options.bow * random.normal()};
  trunk.taper = random.uniform(0.015, 0.04);
  trunk.flare = options.flare * random.uniform(0.3, 1.3);
  trunk.height = random.uniform(10, 16);
  trunk.crown_base = random.uniform(2.8, 7);
  trunk.crown_radius = random.uniform(1.1, 2.3);
  trunk.shade = random.uniform(0.75, 1.3);
  const bool bright = options.bark == Bark::bright || (options.bark == Bark::mixed && random.uniform() < 0.5);
  trunk.bright = bright;
  return trunk;
}

bool isFree(const Eigen::Vector2d &p, const std::vector<SimulatedTrunk> &trunks, double spacing)
{
  return std::none_of(trunks.begin(), trunks.end(), [&](const SimulatedTrunk &other) {
    return (other.foot.head<2>() - p).norm() < spacing + other.radius;
  });
}

/// Darts thrown at the rectangle \p low, \p high until \p count trunks stand, or there is no more room.
template <class Accept>
void throwTrunks(Forest &forest, std::vector<SimulatedTrunk> &trunks, std::uint64_t stream, int first_id, double count,
                 const Eigen::Vector2d &low, const Eigen::Vector2d &high, const Accept &accept)
{
  Random random(forest.options.seed, stream);
  const std::size_t wanted = static_cast<std::size_t>(std::lround(count)) + trunks.size();
  for (std::size_t attempt = 0; attempt < 30 * wanted && trunks.size() < wanted; ++attempt) {
    SimulatedTrunk trunk = grow(random, forest.options);
    const double x = random.uniform(low.x(), high.x()), y = random.uniform(low.y(), high.y());
    if (!accept(Eigen::Vector2d(x, y), trunk) || !isFree({x, y}, trunks, kSpacing + trunk.radius))
      continue;
    trunk.id = first_id + static_cast<int>(trunks.size());
    trunk.foot = {x, y, forest.terrain.height(x, y)};
    trunks.push_back(trunk);
  }
}

void plantUndergrowth(Forest &forest, const std::vector<Eigen::Vector3d> &path)
{
  const ForestOptions &options = forest.options;
  const Eigen::Vector2d size = forest.near_max - forest.near_min;
  Random random(options.seed, kBushes);
  for (int k = static_cast<int>(options.undergrowth * size.prod()); k > 0; --k) {
    const double x = random.uniform(forest.near_min.x(), forest.near_max.x());
    const double y = random.uniform(forest.near_min.y(), forest.near_max.y());
    const double radius = random.uniform(0.25, 0.75), height = random.uniform(0.25, 0.8);
    const double shade = random.uniform(0.6, 1.4);
    if (distanceToPath({x, y}, path) > radius + 0.5)
      forest.bushes.push_back({{x, y, forest.terrain.height(x, y)}, radius, height, shade});
  }
  Random stems(options.seed, kSaplings);
  for (int k = static_cast<int>(options.saplings * size.prod()); k > 0; --k) {
    const double x = stems.uniform(forest.near_min.x(), forest.near_max.x());
    const double y = stems.uniform(forest.near_min.y(), forest.near_max.y());
    const Eigen::Vector2d lean(0.12 * stems.normal(), 0.12 * stems.normal());
    const double radius = stems.uniform(0.01, 0.025), height = stems.uniform(0.8, 3);
    if (distanceToPath({x, y}, path) > 0.8)
      forest.saplings.push_back({{x, y, forest.terrain.height(x, y)}, lean, radius, height});
  }
}

void placeSun(Forest &forest)
{
  Random random(forest.options.seed, kSun);
  const double azimuth = random.uniform(0, 2 * M_PI), elevation = random.uniform(0.3, 0.8);
  forest.to_sun = {std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                   std::sin(elevation)};
}
} // namespace

Eigen::Vector3d SimulatedTrunk::axisAt(double h) const
{
  const double arch = 4 * h / height * (1 - h / height);
  return {foot.x() + lean.x() * h + bow.x() * arch, foot.y() + lean.y() * h + bow.y() * arch, foot.z() + h};
}

double SimulatedTrunk::radiusAt(double h) const
{
  constexpr double kFlareHeight = 0.15;
  const double cone = std::max(0.1, 1 - taper * (h - kBreastHeight));
  return radius * (cone + flare * std::exp(-std::max(0.0, h) / kFlareHeight));
}

Trunk SimulatedTrunk::cylinder() const
{
  const Eigen::Vector3d low = axisAt(0.6), high = axisAt(2.0);
  Trunk trunk;
  trunk.lean = (high - low).head<2>() / (high - low).z();
  trunk.xy = low.head<2>() - trunk.lean * low.z();
  trunk.log_radius = std::log(radius);
  return trunk;
}

Terrain::Terrain(std::uint64_t seed, double amplitude)
{
  Random random(seed, kTerrain);
  for (Wave &wave : m_waves) {
    const double length = random.uniform(3, 25), direction = random.uniform(0, 2 * M_PI);
    wave.kx = 2 * M_PI / length * std::cos(direction);
    wave.ky = 2 * M_PI / length * std::sin(direction);
    wave.phase = random.uniform(0, 2 * M_PI);
    wave.amplitude = amplitude * std::min(1.0, length / 12) * random.uniform(0.3, 0.7);
  }
  m_offset = height(0, 0);
}

double Terrain::height(double x, double y) const
{
  double z = -m_offset;
  for (const Wave &wave : m_waves)
    z += wave.amplitude * std::sin(wave.kx * x + wave.ky * y + wave.phase);
  return z;
}

Forest Forest::plant(const ForestOptions &options, const std::vector<Eigen::Vector3d> &path,
                     const std::vector<SimulatedTrunk> &wanted)
{
  if (path.empty())
    throw badValue("path = (no points), must be at least one point");
  Forest forest;
  forest.options = options;
  forest.terrain = Terrain(options.seed, options.ground_amplitude);
  placeSun(forest);
  forest.near_min = forest.near_max = path.front().head<2>();
  for (const Eigen::Vector3d &p : path) {
    forest.near_min = forest.near_min.cwiseMin(p.head<2>());
    forest.near_max = forest.near_max.cwiseMax(p.head<2>());
  }
  forest.near_min.array() -= options.margin;
  forest.near_max.array() += options.margin;
  for (SimulatedTrunk trunk : wanted) {
    trunk.id = static_cast<int>(forest.trunks.size());
    trunk.foot.z() = forest.terrain.height(trunk.foot.x(), trunk.foot.y());
    forest.trunks.push_back(trunk);
  }
  const double area = (forest.near_max - forest.near_min).prod();
  throwTrunks(forest, forest.trunks, kNear, 0, options.density * area, forest.near_min, forest.near_max,
              [&](const Eigen::Vector2d &p, const SimulatedTrunk &trunk) {
                return distanceToPath(p, path) > options.clearance + trunk.radius * (1 + 0.3 * trunk.flare);
              });
  const Eigen::Vector2d reach(kFarRadius, kFarRadius);
  const Eigen::Vector2d low = forest.near_min - reach, high = forest.near_max + reach;
  const double far_area = (high - low).prod() - area;
  throwTrunks(forest, forest.far_trunks, kFar, 10000, std::min(options.density * 0.3, kFarDensity) * far_area, low,
              high, [&](const Eigen::Vector2d &p, const SimulatedTrunk &) {
                return (p.array() < forest.near_min.array()).any() || (p.array() > forest.near_max.array()).any();
              });
  plantUndergrowth(forest, path);
  return forest;
}

double Forest::distanceToBark(const Eigen::Vector3d &point) const
{
  double best = std::numeric_limits<double>::infinity();
  for (const SimulatedTrunk &trunk : trunks) {
    const double h = std::clamp(point.z() - trunk.foot.z(), 0.0, trunk.height);
    best = std::min(best, (trunk.axisAt(h) - point).head<2>().norm() - trunk.radiusAt(h));
  }
  return best;
}
} // namespace bole
