// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What ForestRenderer is made of: quadrilaterals for the ray caster, textures, light and the sensor.
#include "simulation/embree.h"
#include "simulation/forest.h"
#include "simulation/forest_renderer.h"

#include <cstdint>
#include <vector>

namespace bole
{
/// Quadrilaterals with shared vertices. Within quad (v0, v1, v2, v3) the ray caster's (u, v) runs
/// from v0 to v1 and from v0 to v3.
struct QuadMesh
{
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::uint32_t> indices; ///< four a quad

  std::uint32_t add(const Eigen::Vector3d &vertex);
  void addQuad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d);
  std::size_t size() const { return indices.size() / 4; }
};

/// Where a quad of bark is on its trunk.
struct BarkQuad
{
  std::uint16_t trunk;           ///< index into near trunks followed by far trunks
  std::uint16_t side, sides;     ///< which of how many round the trunk
  float height_low, height_high; ///< above the foot [m]
};

/// A cluster of leaves or a piece of a twig.
struct Leaf
{
  float albedo;
};

struct ForestMesh
{
  QuadMesh ground, bark, leaves;
  std::vector<BarkQuad> bark_quads;
  std::vector<Leaf> leaf_quads;

  explicit ForestMesh(const Forest &forest);
};

/// The meshes of a forest in Embree's hands, freed with this object.
class RayScene
{
public:
  enum Geometry : unsigned
  {
    kGround = 0,
    kBark = 1,
    kLeaves = 2
  };

  explicit RayScene(const ForestMesh &mesh);
  ~RayScene();
  RayScene(const RayScene &) = delete;
  RayScene &operator=(const RayScene &) = delete;

  /// True when something stands between \p from and infinity (or \p reach [m]) along \p direction.
  bool occluded(const Eigen::Vector3d &from, const Eigen::Vector3d &direction, double reach = 200) const;
  /// Sixteen neighbouring rays at once. \p valid has -1 for the rays to trace.
  void intersect(const int *valid, RTCRayHit16 &rays) const;

private:
  void attach(const QuadMesh &mesh, unsigned id);

  RTCDevice m_device = nullptr;
  RTCScene m_scene = nullptr;
};

/// A periodic grey texture with its halved copies, so that far surfaces do not alias: tabulated noise for bark and
/// ground.
class NoiseTexture
{
public:
  /// \param columns, rows powers of two.
  NoiseTexture(int columns, int rows, std::vector<float> texels);

  /// Value at (u, v) in texels of the finest level, wrapped, nearest texel of the level whose
  /// texels are about \p footprint fine texels large.
  float at(float u, float v, float footprint) const
  {
    int level = 0;
    while (footprint > 1.5f && level + 1 < static_cast<int>(m_levels.size())) {
      footprint *= 0.5f;
      u *= 0.5f;
      v *= 0.5f;
      ++level;
    }
    const Level &texels = m_levels[level];
    const int column = static_cast<int>(u + 65536.f) & (texels.columns - 1);
    const int row = static_cast<int>(v + 65536.f) & (texels.rows - 1);
    return texels.values[row * texels.columns + column];
  }

private:
  struct Level
  {
    int columns, rows;
    std::vector<float> values;
  };
  std::vector<Level> m_levels;
};

/// Furrowed bark: 256 texels round the trunk, 1024 along it; mean 1.
NoiseTexture furrowedBark(std::uint64_t seed);
/// Smooth bright bark with dark cross marks, as of birch and aspen; mean near 1.
NoiseTexture smoothBark(std::uint64_t seed);
/// Grass, leaves and soil, 1024x1024 texels; mean 1.
NoiseTexture groundCover(std::uint64_t seed);

/// A regular grid of values with bilinear look-up, clamped at its borders. Of the ground: x and y in the world [m]; of
/// a trunk: x from 0 to 1 round it, y its height above the foot [m].
struct LightGrid
{
  float x0 = 0, y0 = 0, columns_per_x = 1, rows_per_y = 1;
  int columns = 0, rows = 0;
  bool is_round = false; ///< the first column stands beside the last
  std::vector<float> values;

  bool contains(float x, float y) const
  {
    const float u = (x - x0) * columns_per_x, v = (y - y0) * rows_per_y;
    return u >= 0 && v >= 0 && u < columns - 1 && v < rows - 1;
  }
  float at(float x, float y) const;
};

/// Light that does not depend on the camera, computed once: irradiance over pi of ground, bark and leaves.
struct LightMaps
{
  LightGrid near_ground, far_ground;
  std::vector<LightGrid> bark; ///< one a trunk, near ones first
  std::vector<float> leaves;   ///< one a quad
  float sun = 0,
        sky = 1; ///< irradiance over pi of a plane that faces the sun, of one that faces the sky

  LightMaps(const Forest &forest, const ForestMesh &mesh, const RayScene &scene);
};

/// From light on the sensor to grey levels: automatic exposure, noise, quantisation.
class SensorImage
{
public:
  explicit SensorImage(const RendererOptions &options);
  /// Takes the next picture; returns its gain (grey levels per unit of radiance).
  double expose(const std::vector<float> &radiance, vpImage<unsigned char> &image);

private:
  double meanGrey(const std::vector<float> &radiance, double gain) const;
  double stepped(double gain) const;

  RendererOptions m_options;
  std::vector<float> m_normals; ///< tabulated normal numbers
  std::uint64_t m_frame = 0;
  double m_gain = 0; ///< 0 before the first picture
};
} // namespace bole
