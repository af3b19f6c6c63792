// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/renderer_parts.h"

#include "simulation/random.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kGroundBounce = 0.14; ///< light that comes back from the ground, relative to the sky's

/// Part of the sky that a point sees, weighted by the cosine to its normal; a few fixed directions.
double skyShare(const RayScene &scene, const Eigen::Vector3d &point, const Eigen::Vector3d &normal)
{
  static const std::array<Eigen::Vector3d, 12> directions = [] {
    std::array<Eigen::Vector3d, 12> all;
    for (int k = 0; k < 12; ++k) {
      const double z = (k + 0.5) / 12, azimuth = 2.399963 * k; // golden angle
      const double side = std::sqrt(1 - z * z);
      all[k] = {side * std::cos(azimuth), side * std::sin(azimuth), z};
    }
    return all;
  }();
  double seen = 0;
  for (const Eigen::Vector3d &direction : directions) {
    const double cosine = normal.dot(direction);
    if (cosine > 0 && !scene.occluded(point, direction, 40))
      seen += cosine;
  }
  return seen / 6; // 6 = the sum of the cosines on open ground
}

LightGrid emptyGrid(const Eigen::Vector2d &low, const Eigen::Vector2d &high, double cell)
{
  LightGrid grid;
  grid.x0 = static_cast<float>(low.x());
  grid.y0 = static_cast<float>(low.y());
  grid.columns_per_x = grid.rows_per_y = static_cast<float>(1 / cell);
  grid.columns = static_cast<int>((high.x() - low.x()) / cell) + 2;
  grid.rows = static_cast<int>((high.y() - low.y()) / cell) + 2;
  grid.values.resize(static_cast<std::size_t>(grid.columns) * grid.rows);
  return grid;
}

template <class Value> void fill(LightGrid &grid, const Value &value)
{
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const double x = grid.x0 + column / grid.columns_per_x, y = grid.y0 + row / grid.rows_per_y;
      grid.values[static_cast<std::size_t>(row) * grid.columns + column] = static_cast<float>(value(x, y));
    }
  }
}

LightGrid groundLight(const Forest &forest, const RayScene &scene, const LightMaps &maps, const Eigen::Vector2d &low,
                      const Eigen::Vector2d &high, double cell, double sky_cell)
{
  const auto above = [&](double x, double y) { return Eigen::Vector3d(x, y, forest.terrain.height(x, y) + 0.03); };
  LightGrid sky = emptyGrid(low, high, sky_cell);
  fill(sky, [&](double x, double y) {
    return maps.sky * (0.15 + 0.85 * skyShare(scene, above(x, y), Eigen::Vector3d::UnitZ()));
  });
  LightGrid grid = emptyGrid(low, high, cell);
  fill(grid, [&](double x, double y) {
    double light = sky.at(static_cast<float>(x), static_cast<float>(y));
    if (maps.sun > 0 && !scene.occluded(above(x, y), forest.to_sun))
      light += maps.sun * forest.to_sun.z();
    return light;
  });
  return grid;
}

LightGrid emptyBark(int columns, int rows, double height)
{
  LightGrid grid;
  grid.is_round = true;
  grid.columns = columns;
  grid.rows = rows;
  grid.columns_per_x = static_cast<float>(columns);
  grid.rows_per_y = static_cast<float>((rows - 1) / height);
  grid.values.resize(static_cast<std::size_t>(columns) * rows);
  return grid;
}

LightGrid barkLight(const Forest &forest, const SimulatedTrunk &trunk, const RayScene &scene, const LightMaps &maps,
                    bool far)
{
  const auto pointAndNormal = [&trunk](double turn, double height) {
    const Eigen::Vector3d normal(std::cos(2 * M_PI * turn), std::sin(2 * M_PI * turn), 0);
    return std::pair(Eigen::Vector3d(trunk.axisAt(height) + (trunk.radiusAt(height) + 0.02) * normal), normal);
  };
  const double reach = far ? 10 : 8;
  LightGrid sky = emptyBark(8, far ? 2 : 6, reach);
  fill(sky, [&](double turn, double height) {
    const auto [point, normal] = pointAndNormal(turn, std::max(0.1, height));
    return maps.sky * (0.12 + kGroundBounce + 1.0 * skyShare(scene, point, normal)) + kGroundBounce * maps.sun * 0.4;
  });
  LightGrid map = far ? emptyBark(8, 4, reach) : emptyBark(32, 100, reach);
  fill(map, [&](float turn, float height) {
    double light = sky.at(turn, height);
    const auto [point, normal] = pointAndNormal(turn, height);
    const double cosine = normal.dot(forest.to_sun);
    if (maps.sun > 0 && cosine > 0 && !scene.occluded(point, forest.to_sun))
      light += maps.sun * cosine;
    return light;
  });
  return map;
}

std::vector<float> leafLight(const Forest &forest, const ForestMesh &mesh, const RayScene &scene, const LightMaps &maps)
{
  std::vector<float> light(mesh.leaves.size());
  for (std::size_t k = 0; k < light.size(); ++k) {
    const auto corner = [&](int n) {
      return mesh.leaves.vertices[mesh.leaves.indices[4 * k + n]].cast<double>().eval();
    };
    const Eigen::Vector3d normal = (corner(2) - corner(0)).cross(corner(3) - corner(1)).normalized();
    const Eigen::Vector3d centre = 0.25 * (corner(0) + corner(1) + corner(2) + corner(3));
    double value = maps.sky * (0.35 + 0.4 * std::abs(normal.z()));
    if (maps.sun > 0 && !scene.occluded(centre + 0.03 * forest.to_sun, forest.to_sun))
      value += 0.75 * maps.sun * std::abs(normal.dot(forest.to_sun)); // leaves let light through
    light[k] = static_cast<float>(value);
  }
  return light;
}
} // namespace

float LightGrid::at(float x, float y) const
{
  const float u =
      is_round ? (x - std::floor(x)) * columns_per_x : std::clamp((x - x0) * columns_per_x, 0.f, columns - 1.001f);
  const float v = std::clamp((y - y0) * rows_per_y, 0.f, rows - 1.001f);
  const int column = static_cast<int>(u) % columns, next = (column + 1) % columns, row = static_cast<int>(v);
  const float fu = u - std::floor(u), fv = v - row;
  const float *low = &values[static_cast<std::size_t>(row) * columns], *high = low + columns;
  return (low[column] * (1 - fu) + low[next] * fu) * (1 - fv) + (high[column] * (1 - fu) + high[next] * fu) * fv;
}

LightMaps::LightMaps(const Forest &forest, const ForestMesh &mesh, const RayScene &scene)
{
  const bool sunny = forest.options.light == Light::sun;
  sun = sunny ? 1.5f : 0.f;
  sky = sunny ? 0.45f : 1.f;
  near_ground = groundLight(forest, scene, *this, forest.near_min, forest.near_max, 0.1, 0.7);
  const Eigen::Vector2d reach(90, 90);
  far_ground = groundLight(forest, scene, *this, forest.near_min - reach, forest.near_max + reach, 0.6, 6);
  for (const SimulatedTrunk &trunk : forest.trunks)
    bark.push_back(barkLight(forest, trunk, scene, *this, false));
  for (const SimulatedTrunk &trunk : forest.far_trunks)
    bark.push_back(barkLight(forest, trunk, scene, *this, true));
  leaves = leafLight(forest, mesh, scene, *this);
}
} // namespace bole
