// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The forest as quadrilaterals for the ray caster.

#include "simulation/embree.h"
#include "simulation/forest.h"

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
} // namespace bole
