// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/renderer_parts.h"

#include "simulation/random.h"
#include "support/text.h"

#include <Eigen/Geometry>

#include <cmath>
#include <cstring>

namespace bole
{
namespace
{
constexpr int kNearSides = 24, kFarSides = 8;

/// A regular polygon whose mean width is that of the circle of radius 1 has this circumradius.
double polygonRadius(int sides)
{
  const double half = M_PI / sides;
  return half / std::sin(half);
}

std::vector<double> ringHeights(const SimulatedTrunk &trunk, bool far)
{
  if (far)
    return {-0.3, 0.4, 3, 7, trunk.height};
  std::vector<double> heights{-0.3, 0, 0.05, 0.1, 0.16, 0.24, 0.34, 0.5, 0.75};
  for (double h = 1; h < 4; h += 0.5)
    heights.push_back(h);
  for (double h = 4; h < trunk.height; h += 1.5)
    heights.push_back(h);
  heights.push_back(trunk.height);
  return heights;
}

void addTrunk(ForestMesh &mesh, const SimulatedTrunk &trunk, std::uint16_t index, bool far)
{
  const int sides = far ? kFarSides : kNearSides;
  const std::vector<double> heights = ringHeights(trunk, far);
  const double scale = polygonRadius(sides);
  std::uint32_t below = 0;
  for (std::size_t ring = 0; ring < heights.size(); ++ring) {
    const Eigen::Vector3d centre = trunk.axisAt(heights[ring]);
    const double radius = scale * trunk.radiusAt(heights[ring]);
    const std::uint32_t first = static_cast<std::uint32_t>(mesh.bark.vertices.size());
    for (int side = 0; side < sides; ++side) {
      const double angle = 2 * M_PI * side / sides;
      mesh.bark.add(centre + radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0));
    }
    for (int side = 0; ring > 0 && side < sides; ++side) {
      const int next = (side + 1) % sides;
      mesh.bark.addQuad(below + side, below + next, first + next, first + side);
      mesh.bark_quads.push_back({index, static_cast<std::uint16_t>(side), static_cast<std::uint16_t>(sides),
                                 static_cast<float>(heights[ring - 1]), static_cast<float>(heights[ring])});
    }
    below = first;
  }
}

void addLeaf(ForestMesh &mesh, const Eigen::Vector3d &centre, double size, double albedo, Random &random)
{
  const Eigen::Vector3d normal = random.normal3(1).normalized();
  const Eigen::Vector3d u = normal.unitOrthogonal() * size * random.uniform(0.6, 1.2);
  const Eigen::Vector3d v = normal.cross(u).normalized() * size * random.uniform(0.4, 0.9);
  const std::uint32_t a = mesh.leaves.add(centre - u), b = mesh.leaves.add(centre - v);
  const std::uint32_t c = mesh.leaves.add(centre + u), d = mesh.leaves.add(centre + v);
  mesh.leaves.addQuad(a, b, c, d);
  mesh.leaf_quads.push_back({static_cast<float>(albedo)});
}

/// A thin prism of three sides.
void addTwig(ForestMesh &mesh, const Eigen::Vector3d &from, const Eigen::Vector3d &to, double radius, double albedo)
{
  const Eigen::Vector3d axis = (to - from).normalized();
  const Eigen::Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
  std::uint32_t low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    const double angle = 2 * M_PI * k / 3;
    const Eigen::Vector3d offset = radius * (std::cos(angle) * u + std::sin(angle) * v);
    low[k] = mesh.leaves.add(from + offset);
    high[k] = mesh.leaves.add(to + 0.4 * offset);
  }
  for (int k = 0; k < 3; ++k) {
    mesh.leaves.addQuad(low[k], low[(k + 1) % 3], high[(k + 1) % 3], high[k]);
    mesh.leaf_quads.push_back({static_cast<float>(albedo)});
  }
}

/// Point in the unit ball, denser towards its skin.
Eigen::Vector3d inCrown(Random &random)
{
  const Eigen::Vector3d direction = random.normal3(1).normalized();
  return direction * std::pow(random.uniform(), 0.25);
}

void addCrown(ForestMesh &mesh, const SimulatedTrunk &trunk, int leaves, double leaf_size, bool twigs, Random &random)
{
  const double half = 0.5 * (trunk.height - trunk.crown_base);
  const double middle = trunk.crown_base + half;
  for (int k = 0; k < leaves; ++k) {
    const Eigen::Vector3d p = inCrown(random);
    const double h = middle + half * p.z();
    const Eigen::Vector3d centre =
        trunk.axisAt(h) + trunk.crown_radius * Eigen::Vector3d(p.x(), p.y(), 0) * (1 - 0.3 * p.z());
    addLeaf(mesh, centre, leaf_size * random.uniform(0.6, 1.3), random.uniform(0.05, 0.16), random);
  }
  const int branches = twigs ? static_cast<int>(random.uniform(0, 9)) : 0;
  for (int k = 0; k < branches; ++k) {
    const double h = random.uniform(0.35 * trunk.crown_base, trunk.crown_base + half);
    const double angle = random.uniform(0, 2 * M_PI), length = random.uniform(0.4, 1.6);
    const Eigen::Vector3d out(std::cos(angle), std::sin(angle), random.uniform(-0.2, 0.7));
    const Eigen::Vector3d tip = trunk.axisAt(h) + length * out;
    addTwig(mesh, trunk.axisAt(h), tip, 0.012 + 0.08 * trunk.radius, 0.12 * trunk.shade);
    for (int leaf = 0; leaf < 5; ++leaf)
      addLeaf(mesh, tip - out * random.uniform(0, 0.4) + random.normal3(0.1), 0.09, random.uniform(0.06, 0.18), random);
  }
}

void addBush(ForestMesh &mesh, const Bush &bush, Random &random)
{
  for (int k = 0; k < 130; ++k) {
    Eigen::Vector3d p = inCrown(random);
    p.z() = std::abs(p.z());
    const Eigen::Vector3d centre =
        bush.foot + Eigen::Vector3d(bush.radius * p.x(), bush.radius * p.y(), bush.height * p.z());
    addLeaf(mesh, centre, random.uniform(0.04, 0.1), bush.shade * random.uniform(0.06, 0.22), random);
  }
}

void addSapling(ForestMesh &mesh, const Sapling &sapling, Random &random)
{
  const Eigen::Vector3d top = sapling.foot + sapling.height * Eigen::Vector3d(sapling.lean.x(), sapling.lean.y(), 1);
  addTwig(mesh, sapling.foot - Eigen::Vector3d(0, 0, 0.1), top, sapling.radius, random.uniform(0.08, 0.25));
  for (int k = 0; k < 14; ++k) {
    const double along = random.uniform(0.45, 1.05);
    addLeaf(mesh, sapling.foot + along * (top - sapling.foot) + random.normal3(0.13), 0.06, random.uniform(0.06, 0.2),
            random);
  }
}

/// A grid over everything that can be seen: fine where the drone flies, coarse behind.
void addGround(ForestMesh &mesh, const Forest &forest)
{
  const auto ticks = [](double low, double high) {
    std::vector<double> values;
    for (double t = low - 90; t < low; t += 3)
      values.push_back(t);
    for (double t = low; t < high; t += 0.5)
      values.push_back(t);
    for (double t = high; t <= high + 90; t += 3)
      values.push_back(t);
    return values;
  };
  const std::vector<double> xs = ticks(forest.near_min.x(), forest.near_max.x());
  const std::vector<double> ys = ticks(forest.near_min.y(), forest.near_max.y());
  for (double y : ys)
    for (double x : xs)
      mesh.ground.add({x, y, forest.terrain.height(x, y)});
  const std::uint32_t stride = static_cast<std::uint32_t>(xs.size());
  for (std::uint32_t row = 0; row + 1 < ys.size(); ++row) {
    for (std::uint32_t column = 0; column + 1 < stride; ++column) {
      const std::uint32_t k = row * stride + column;
      mesh.ground.addQuad(k, k + 1, k + stride + 1, k + stride);
    }
  }
}
} // namespace

std::uint32_t QuadMesh::add(const Eigen::Vector3d &vertex)
{
  vertices.push_back(vertex.cast<float>());
  return static_cast<std::uint32_t>(vertices.size() - 1);
}

void QuadMesh::addQuad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d)
{
  indices.insert(indices.end(), {a, b, c, d});
}

ForestMesh::ForestMesh(const Forest &forest)
{
  addGround(*this, forest);
  const double crown_leaves = forest.options.crown_leaves;
  std::uint16_t index = 0;
  for (const SimulatedTrunk &trunk : forest.trunks) {
    Random random(forest.options.seed, 1000 + index);
    addTrunk(*this, trunk, index++, false);
    addCrown(*this, trunk, static_cast<int>(crown_leaves), 0.17, true, random);
  }
  for (const SimulatedTrunk &trunk : forest.far_trunks) {
    Random random(forest.options.seed, 1000 + index);
    addTrunk(*this, trunk, index++, true);
    addCrown(*this, trunk, static_cast<int>(0.4 * crown_leaves), 0.26, false, random);
  }
  Random random(forest.options.seed, 500);
  for (const Bush &bush : forest.bushes)
    addBush(*this, bush, random);
  for (const Sapling &sapling : forest.saplings)
    addSapling(*this, sapling, random);
}

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
