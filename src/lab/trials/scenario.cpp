// SPDX-License-Identifier: GPL-2.0-or-later
#include "trials/servo_trial.h"

#include "simulation/random.h"
#include "support/text.h"
#include "support/units.h"

#include <cmath>

namespace bole
{
namespace
{
constexpr double kFlightHeight = 1.2; ///< where widths are measured [m]
using Path = std::vector<Eigen::Vector3d>;

void add(Path &path, double x, double y) { path.emplace_back(x, y, kFlightHeight); }

void addLine(Path &path, const Eigen::Vector2d &a, const Eigen::Vector2d &b)
{
  const int steps = 1 + static_cast<int>((b - a).norm() / 0.2);
  for (int k = 0; k <= steps; ++k) {
    const Eigen::Vector2d p = a + (b - a) * k / steps;
    add(path, p.x(), p.y());
  }
}

/// Room to sidestep where it takes off.
Path clearStart()
{
  Path path;
  addLine(path, {0, -1}, {0, 1});
  return path;
}

SimulatedTrunk upright(Random &random, double radius)
{
  SimulatedTrunk trunk;
  trunk.radius = radius;
  trunk.lean = {0.03 * random.normal(), 0.03 * random.normal()};
  trunk.bow = {0.04 * random.normal(), 0.04 * random.normal()};
  trunk.taper = random.uniform(0.015, 0.04);
  trunk.flare = 0.5 * random.uniform(0.3, 1.3);
  trunk.crown_base = random.uniform(3, 7);
  trunk.shade = random.uniform(0.75, 1.3);
  trunk.bright = random.uniform() < 0.5;
  return trunk;
}

/// Puts the trunk's axis at \p xy at flight height.
void stand(SimulatedTrunk &trunk, const Eigen::Vector2d &xy)
{
  trunk.foot = Eigen::Vector3d::Zero();
  const Eigen::Vector2d off = trunk.axisAt(kFlightHeight).head<2>();
  trunk.foot.head<2>() = xy - off;
}

Scenario oneTrunk(const ScenarioOptions &options, const ForestOptions &forest, Random &random)
{
  SimulatedTrunk trunk = upright(random, random.uniform(0.1, 0.25));
  const double range = random.uniform(3, 5.5), angle = random.uniform(-10, 10) * kDegree;
  const Eigen::Vector2d at(range * std::cos(angle), range * std::sin(angle));
  stand(trunk, at);
  Path path = clearStart();
  addLine(path, {0, 0}, at - at.normalized() * (trunk.radius + 0.8));
  if (options.kind == ServoKind::circle) // nothing stands in the way round, nor before the trunk
    for (const double share : {0.4, 0.7, 1.0})
      for (double a = 0; a < 2 * M_PI; a += 0.05)
        add(path, at.x() + share * trunk.radius / options.ratio * std::cos(a),
            at.y() + share * trunk.radius / options.ratio * std::sin(a));
  Scenario scenario;
  scenario.forest = Forest::plant(forest, path, {trunk});
  scenario.target = 0;
  return scenario;
}

Scenario twoTrunks(const ForestOptions &forest, Random &random)
{
  SimulatedTrunk one = upright(random, random.uniform(0.1, 0.22)), other = upright(random, random.uniform(0.1, 0.22));
  const double range = random.uniform(4, 6), angle = random.uniform(-10, 10) * kDegree;
  const double turned = angle + random.uniform(-25, 25) * kDegree, width = random.uniform(1.3, 2);
  const Eigen::Vector2d middle(range * std::cos(angle), range * std::sin(angle));
  const Eigen::Vector2d along(std::cos(turned), std::sin(turned)), left(-along.y(), along.x());
  stand(one, middle + (0.5 * width + one.radiusAt(kFlightHeight)) * left);
  stand(other, middle - (0.5 * width + other.radiusAt(kFlightHeight)) * left);
  Path path = clearStart();
  addLine(path, {0, 0}, middle - 1.5 * along);
  addLine(path, middle - 1.5 * along, middle + 3 * along);
  Scenario scenario;
  scenario.forest = Forest::plant(forest, path, {one, other});
  scenario.left = 0;
  scenario.right = 1;
  scenario.gap_width = width;
  return scenario;
}

Scenario stand(const ScenarioOptions &options, ForestOptions forest)
{
  Path path = clearStart();
  addLine(path, {0, 0}, {1.5, 0});
  add(path, options.length + 2, -3); // nothing is kept clear but these points: the corners of the stand
  add(path, options.length + 2, 3);
  Scenario scenario;
  scenario.forest = Forest::plant(forest, path, {});
  return scenario;
}
} // namespace

const char *toString(ServoKind kind) { return nameOf(kind, {"hold", "circle", "gap", "slalom"}); }

std::vector<int> Scenario::askedFor() const
{
  if (target >= 0)
    return {target};
  return left >= 0 ? std::vector<int>{left, right} : std::vector<int>{};
}

void ScenarioOptions::validate() const
{
  requireRange("density", density, 0, 0.3);
  requireRange("ratio", ratio, 0.01, 0.5);
  requireRange("length", length, 1, 1000);
}

Scenario makeScenario(const ScenarioOptions &options)
{
  options.validate();
  Random random(options.seed, 700 + static_cast<std::uint64_t>(options.kind));
  ForestOptions forest;
  forest.seed = options.seed;
  forest.light = random.uniform() < 0.5 ? Light::sun : Light::overcast;
  forest.bark = Bark::mixed;
  const bool is_slalom = options.kind == ServoKind::slalom;
  forest.density = options.density > 0              ? options.density
                   : is_slalom                      ? 0.05
                   : options.kind == ServoKind::gap ? 0.04
                                                    : 0.03;
  if (is_slalom)
    return stand(options, forest);
  return options.kind == ServoKind::gap ? twoTrunks(forest, random) : oneTrunk(options, forest, random);
}
} // namespace bole
