// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/ray_scene.h"
#include "support/text.h"

#include <cstring>

namespace bole
{
RayScene::RayScene(const ForestMesh &mesh)
{
  // One thread: builds are the same every time and a closed loop keeps to its core.
  m_device = rtcNewDevice("threads=1,set_affinity=0");
  if (!m_device)
    throw ioError("Embree could not start on this processor");
  m_scene = rtcNewScene(m_device);
  rtcSetSceneBuildQuality(m_scene, RTC_BUILD_QUALITY_MEDIUM);
  attach(mesh.ground, kGround);
  attach(mesh.bark, kBark);
  attach(mesh.leaves, kLeaves);
  rtcCommitScene(m_scene);
}

RayScene::~RayScene()
{
  rtcReleaseScene(m_scene);
  rtcReleaseDevice(m_device);
}

void RayScene::attach(const QuadMesh &mesh, unsigned id)
{
  if (mesh.size() == 0)
    return;
  RTCGeometry geometry = rtcNewGeometry(m_device, RTC_GEOMETRY_TYPE_QUAD);
  void *vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                           mesh.vertices.size());
  std::memcpy(vertices, mesh.vertices.data(), mesh.vertices.size() * 3 * sizeof(float));
  void *indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4,
                                          4 * sizeof(std::uint32_t), mesh.size());
  std::memcpy(indices, mesh.indices.data(), mesh.indices.size() * sizeof(std::uint32_t));
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(m_scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

bool RayScene::occluded(const Eigen::Vector3d &from, const Eigen::Vector3d &direction, double reach) const
{
  RTCRay ray{};
  ray.org_x = static_cast<float>(from.x());
  ray.org_y = static_cast<float>(from.y());
  ray.org_z = static_cast<float>(from.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = 0.01f;
  ray.tfar = static_cast<float>(reach);
  ray.mask = 0xffffffffu;
  embree::occluded(m_scene, ray);
  return ray.tfar < 0;
}

void RayScene::intersect(const int *valid, RTCRayHit16 &rays) const { embree::intersectCoherent(valid, m_scene, rays); }
} // namespace bole
