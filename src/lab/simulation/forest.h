// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A forest to fly in: what stands where. Its picture is made by forest_renderer.h.

#include <bole/trunk.h>

#include <array>
#include <cstdint>
#include <vector>

namespace bole
{
enum class Light
{
  sun,
  overcast
};
enum class Bark
{
  dark,
  bright,
  mixed
};

/// Lengths in metres.
struct ForestOptions
{
  std::uint64_t seed = 1; ///< same seed and options, same forest to the last bit
  double density = 0.06;  ///< trunks a m^2 near the path, 0 to 0.3: managed stands have 0.03 to 0.12
  Light light = Light::overcast;
  Bark bark = Bark::dark;
  double radius_median = 0.15;   ///< of the trunks at breast height, 0.02 to 1
  double radius_spread = 0.35;   ///< standard deviation of log radius, 0 to 1
  double lean_deg = 1.8;         ///< standard deviation of the lean an axis, 0 to 20
  double bow = 0.04;             ///< standard deviation of the bow at half height an axis, 0 to 0.5
  double flare = 0.5;            ///< widening of the foot, relative to the radius, 0 to 2
  double crown_leaves = 220;     ///< leaf clusters of a near crown, 0 to 2000
  double undergrowth = 0.05;     ///< bushes a m^2, 0 to 1
  double saplings = 0.01;        ///< stems of 1 to 2.5 cm a m^2, not part of the truth, 0 to 1
  double ground_amplitude = 0.1; ///< of the unevenness of the ground, 0 to 1
  double margin = 14;            ///< trunks as near as this to the path's bounding box are part of the truth, 5 to 40
  double clearance = 0.7;        ///< free space between path and bark, 0 to 3
};

/// One trunk: a leaning, bowed, tapering cone with a flared foot.
struct SimulatedTrunk
{
  int id = 0;
  Eigen::Vector3d foot = Eigen::Vector3d::Zero(); ///< on the ground, world
  double radius = 0.15;                           ///< 1.3 m above the foot
  Eigen::Vector2d lean = Eigen::Vector2d::Zero(); ///< tan, as Trunk::lean
  Eigen::Vector2d bow = Eigen::Vector2d::Zero();  ///< offset of the axis at half height
  double taper = 0.02;                            ///< relative loss of radius a metre
  double flare = 0.5;
  double height = 14;
  double crown_base = 5, crown_radius = 1.6;
  double shade = 1; ///< factor on the albedo of the bark
  bool bright = false;

  /// Point of the axis \p h above the foot, world.
  Eigen::Vector3d axisAt(double h) const;
  double radiusAt(double h) const;
  /// The cylinder that fits best where a drone looks: axis and radius between 0.6 and 2 m above the foot.
  Trunk cylinder() const;
};

struct Bush
{
  Eigen::Vector3d foot;
  double radius, height, shade;
};

struct Sapling
{
  Eigen::Vector3d foot;
  Eigen::Vector2d lean;
  double radius, height;
};

/// Gentle hills: a sum of plane waves, zero at the origin of the world.
class Terrain
{
public:
  Terrain() = default;
  Terrain(std::uint64_t seed, double amplitude);
  double height(double x, double y) const;

private:
  struct Wave
  {
    double kx, ky, phase, amplitude;
  };
  std::array<Wave, 8> m_waves{};
  double m_offset = 0;
};

/// Trunks near the path (with truth), trunks far away (scenery, positions only), undergrowth, ground, sun.
struct Forest
{
  ForestOptions options;
  std::vector<SimulatedTrunk> trunks;     ///< ids 0, 1, ...
  std::vector<SimulatedTrunk> far_trunks; ///< ids 10000, 10001, ...
  std::vector<Bush> bushes;
  std::vector<Sapling> saplings;
  Terrain terrain;
  Eigen::Vector3d to_sun = Eigen::Vector3d::UnitZ(); ///< unit vector, world
  Eigen::Vector2d near_min, near_max;                ///< rectangle of the trunks with truth

  /// Plants a forest round \p path (points in the world; nothing grows within the clearance of them). \p wanted trunks
  /// are planted first, as they are, with a new id and the foot put on the ground.
  static Forest plant(const ForestOptions &options, const std::vector<Eigen::Vector3d> &path,
                      const std::vector<SimulatedTrunk> &wanted = {});
  /// Distance from \p point to the nearest bark of a trunk at its height, negative inside; +inf without trunks.
  double distanceToBark(const Eigen::Vector3d &point) const;
};
} // namespace bole
