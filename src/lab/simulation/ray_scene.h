// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The meshes of a forest in Embree's hands, freed with this object.

#include "simulation/embree.h"
#include "simulation/forest_mesh.h"

namespace bole
{
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
