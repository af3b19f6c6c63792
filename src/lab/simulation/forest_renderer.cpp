// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/forest_renderer.h"

#include "support/text.h"

#include "simulation/renderer_parts.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr std::uint16_t kNothing = 65535;
constexpr double kDepthReach = 65; ///< [m]

/// Directions (x, y, 1) through the corners of the pixels of a camera with its lens.
class RayTable
{
public:
  explicit RayTable(const CameraModel &camera) : m_stride(camera.pinhole.width + 1)
  {
    for (int row = 0; row <= camera.pinhole.height; ++row)
      for (int column = 0; column <= camera.pinhole.width; ++column)
        m_xy.push_back(undistorted(camera, {column - 0.5, row - 0.5}).cast<float>());
  }
  /// At (column + fu, row + fv), fu and fv from 0 to 1 across the pixel.
  Eigen::Vector2f at(int column, int row, float fu, float fv) const
  {
    const Eigen::Vector2f *p = &m_xy[static_cast<std::size_t>(row) * m_stride + column];
    return (p[0] * (1 - fu) + p[1] * fu) * (1 - fv) + (p[m_stride] * (1 - fu) + p[m_stride + 1] * fu) * fv;
  }

private:
  static Eigen::Vector2d undistorted(const CameraModel &camera, const Eigen::Vector2d &u_px)
  {
    const Eigen::Vector2d f(camera.pinhole.fx, camera.pinhole.fy);
    Eigen::Vector2d xy = camera.pinhole.ray(u_px).head<2>();
    Eigen::Vector2d residual = u_px - camera.distort(xy);
    for (int k = 0; k < 100 && residual.norm() > 1e-7; ++k) {
      xy += 0.8 * residual.cwiseQuotient(f);
      residual = u_px - camera.distort(xy);
    }
    if (!(residual.norm() < 0.01)) {
      throw badValue("distortion = no ray reaches pixel ({}, {}), must be a lens that covers the image", u_px.x(),
                     u_px.y());
    }
    return xy;
  }

  int m_stride;
  std::vector<Eigen::Vector2f> m_xy;
};
} // namespace

/// Those of one place of every pixel, 4x4 pixels after 4x4 pixels: they do not change from frame to frame.
struct RayTiles
{
  int columns; ///< tiles in a row
  std::vector<float> x, y;
  std::vector<int> valid; ///< -1, or 0 beyond the right or lower border

  RayTiles(const RayTable &table, int width, int height, float fu, float fv) : columns((width + 3) / 4)
  {
    for (int row = 0; row < height; row += 4)
      for (int column = 0; column < width; column += 4)
        for (int k = 0; k < 16; ++k) {
          const int u = column + (k & 3), v = row + (k >> 2);
          const Eigen::Vector2f xy = table.at(std::min(u, width - 1), std::min(v, height - 1), fu, fv);
          x.push_back(xy.x());
          y.push_back(xy.y());
          valid.push_back(u < width && v < height ? -1 : 0);
        }
  }
  std::size_t first(int column0, int row0) const
  {
    return 16 * (static_cast<std::size_t>(row0 / 4) * columns + column0 / 4);
  }
};

namespace
{
/// Of the sample: a rank-1 lattice, regular in time, well spread over the pixel in both directions.
RayTiles tilesOf(const RayTable &table, const PinholeCamera &camera, int sample)
{
  return {table, camera.width, camera.height, std::fmod(0.5f + sample * 0.7548777f, 1.f),
          std::fmod(0.5f + sample * 0.5698403f, 1.f)};
}

/// atan2 to 2e-6 rad: what clouds and far woods are looked up by.
float azimuthOf(float x, float y)
{
  const float ax = std::abs(x), ay = std::abs(y), t = std::min(ax, ay) / std::max(std::max(ax, ay), 1e-20f), t2 = t * t;
  float angle =
      t * (0.99997726f +
           t2 * (-0.33262347f + t2 * (0.19354346f + t2 * (-0.11643287f + t2 * (0.05265332f - 0.01172120f * t2)))));
  angle = ay > ax ? 1.57079633f - angle : angle;
  angle = x < 0 ? 3.14159265f - angle : angle;
  return y < 0 ? -angle : angle;
}
} // namespace

void RendererOptions::validate() const
{
  requireRange("width", camera.pinhole.width, 16, 4096);
  requireRange("height", camera.pinhole.height, 16, 4096);
  requireRange("samples_per_pixel", samples_per_pixel, 1, 64);
  requireRange("exposure_target", exposure_target, 20, 230);
  requireRange("exposure_lag_frames", exposure_lag_frames, 0, 100);
  requireRange("gain_step", gain_step, 0, 0.5);
  requireRange("read_noise", read_noise, 0, 50);
  requireRange("shot_noise", shot_noise, 0, 5);
}

struct ForestRenderer::State
{
  State(const Forest &forest_, const RendererOptions &options_);
  void trace(const Pose &wMc_open, const Pose &wMc_close);
  void traceTruth(const Pose &wMc, RenderedFrame &frame) const;
  static void aim(const Pose &wMc, const RayTiles &tiles, std::size_t first, RTCRayHit16 &packet);
  float shade(const RTCRayHit16 &rays, int k) const;
  float shadeGround(const Eigen::Vector3f &p, float distance) const;
  float shadeBark(unsigned quad, float u, float v, float distance) const;
  float skyAt(const Eigen::Vector3f &direction) const;
  const SimulatedTrunk &trunkAt(unsigned quad) const;

  Forest forest;
  RendererOptions options;
  ForestMesh mesh;
  RayScene scene;
  LightMaps light;
  RayTiles centres;            ///< rays through the middle of the pixels
  std::vector<RayTiles> tiles; ///< one a sample
  NoiseTexture furrowed, smooth, cover;
  SensorImage sensor;
  std::vector<float> radiance;
  float haze_radiance, haze_length, pixel_angle, ground_albedo;
};

ForestRenderer::State::State(const Forest &forest_, const RendererOptions &options_)
    : forest(forest_),
      options(options_),
      mesh(forest),
      scene(mesh),
      light(forest, mesh, scene),
      centres(RayTable(options.camera), options.camera.pinhole.width, options.camera.pinhole.height, 0.5f, 0.5f),
      furrowed(furrowedBark(forest.options.seed)),
      smooth(smoothBark(forest.options.seed)),
      cover(groundCover(forest.options.seed)),
      sensor(options),
      radiance(static_cast<std::size_t>(options.camera.pinhole.width) * options.camera.pinhole.height)
{
  const RayTable table(options.camera);
  for (int sample = 0; sample < options.samples_per_pixel; ++sample)
    tiles.push_back(tilesOf(table, options.camera.pinhole, sample));
  const bool sunny = forest.options.light == Light::sun;
  haze_radiance = sunny ? 0.45f : 0.8f;
  haze_length = sunny ? 110.f : 80.f;
  ground_albedo = sunny ? 0.3f : 0.42f;
  pixel_angle = static_cast<float>(1 / options.camera.pinhole.fx);
}

const SimulatedTrunk &ForestRenderer::State::trunkAt(unsigned quad) const
{
  const std::size_t index = mesh.bark_quads[quad].trunk;
  return index < forest.trunks.size() ? forest.trunks[index] : forest.far_trunks[index - forest.trunks.size()];
}

/// Rays of the 4x4 pixels whose directions stand at \p first of \p tiles. The parameter of a ray is its depth along the
/// optical axis.
void ForestRenderer::State::aim(const Pose &wMc, const RayTiles &tiles, std::size_t first, RTCRayHit16 &packet)
{
  const Eigen::Matrix3f R = wMc.R.cast<float>();
  const Eigen::Vector3f t = wMc.t.cast<float>();
  const float *x = &tiles.x[first], *y = &tiles.y[first];
  for (int k = 0; k < 16; ++k) {
    packet.ray.dir_x[k] = R(0, 0) * x[k] + R(0, 1) * y[k] + R(0, 2);
    packet.ray.dir_y[k] = R(1, 0) * x[k] + R(1, 1) * y[k] + R(1, 2);
    packet.ray.dir_z[k] = R(2, 0) * x[k] + R(2, 1) * y[k] + R(2, 2);
  }
  std::fill_n(packet.ray.org_x, 16, t.x());
  std::fill_n(packet.ray.org_y, 16, t.y());
  std::fill_n(packet.ray.org_z, 16, t.z());
  std::fill_n(packet.ray.tnear, 16, 0.02f);
  std::fill_n(packet.ray.tfar, 16, 300.f);
  std::fill_n(packet.ray.time, 16, 0.f);
  std::fill_n(packet.ray.mask, 16, 0xffffffffu);
  std::fill_n(packet.ray.flags, 16, 0u);
  std::fill_n(packet.hit.geomID, 16, RTC_INVALID_GEOMETRY_ID);
  std::fill_n(packet.hit.instID[0], 16, RTC_INVALID_GEOMETRY_ID);
}

float ForestRenderer::State::skyAt(const Eigen::Vector3f &direction) const
{
  const Eigen::Vector3f d = direction.normalized();
  const float azimuth = azimuthOf(d.x(), d.y());
  const float ridge = 0.03f + 0.05f * cover.at(azimuth * 90, 300, 6);
  if (d.z() < ridge) // woods beyond the scenery, with stems in them
    return haze_radiance * (0.55f + 0.3f * furrowed.at(azimuth * 800, 2000 * d.z(), 1));
  const float cloud = 0.8f + 0.2f * cover.at(azimuth * 60, 200 * d.z(), 8);
  if (forest.options.light == Light::overcast)
    return cloud * (1.15f - 0.2f * d.z());
  const float to_sun = std::max(0.f, d.dot(forest.to_sun.cast<float>()));
  const float glow = to_sun * to_sun * to_sun;
  return cloud * (0.6f - 0.2f * d.z()) + 0.5f * glow * glow;
}

float ForestRenderer::State::shadeGround(const Eigen::Vector3f &p, float distance) const
{
  const float footprint = 1.7f * distance * pixel_angle; // seen at a grazing angle
  const float fine = cover.at(p.x() * 90, p.y() * 90, footprint * 90);
  const float wide = cover.at(300 + p.y() * 7, p.x() * 7, footprint * 7);
  const LightGrid &grid = light.near_ground.contains(p.x(), p.y()) ? light.near_ground : light.far_ground;
  return ground_albedo * fine * (0.5f + 0.5f * wide) * grid.at(p.x(), p.y());
}

float ForestRenderer::State::shadeBark(unsigned quad, float u, float v, float distance) const
{
  const BarkQuad &bark = mesh.bark_quads[quad];
  const SimulatedTrunk &trunk = trunkAt(quad);
  const float turn = (bark.side + u) / bark.sides;
  const float height = bark.height_low + v * (bark.height_high - bark.height_low);
  const NoiseTexture &texture = trunk.bright ? smooth : furrowed;
  const float texels_per_m = 256 / (6.2832f * static_cast<float>(std::max(0.12, trunk.radius)));
  const float footprint = distance * pixel_angle * texels_per_m;
  const float grain = texture.at(256 * turn + 37.f * bark.trunk, height * texels_per_m + 211.f * bark.trunk, footprint);
  const float albedo = (trunk.bright ? 0.45f : 0.17f) * static_cast<float>(trunk.shade);
  return albedo * grain * light.bark[bark.trunk].at(turn, height);
}

float ForestRenderer::State::shade(const RTCRayHit16 &packet, int k) const
{
  const Eigen::Vector3f direction(packet.ray.dir_x[k], packet.ray.dir_y[k], packet.ray.dir_z[k]);
  if (packet.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID)
    return skyAt(direction);
  const float distance = packet.ray.tfar[k];
  float value = 0;
  if (packet.hit.geomID[k] == RayScene::kGround) {
    const Eigen::Vector3f origin(packet.ray.org_x[k], packet.ray.org_y[k], packet.ray.org_z[k]);
    value = shadeGround(origin + distance * direction, distance);
  }
  else if (packet.hit.geomID[k] == RayScene::kBark) {
    value = shadeBark(packet.hit.primID[k], packet.hit.u[k], packet.hit.v[k], distance);
  }
  else {
    value = mesh.leaf_quads[packet.hit.primID[k]].albedo * light.leaves[packet.hit.primID[k]];
  }
  const float clear = std::exp(-distance / haze_length);
  return value * clear + haze_radiance * (1 - clear);
}

void ForestRenderer::State::trace(const Pose &wMc_open, const Pose &wMc_close)
{
  const int width = options.camera.pinhole.width, height = options.camera.pinhole.height;
  const int samples = options.samples_per_pixel;
  std::fill(radiance.begin(), radiance.end(), 0.f);
  const Vector6d motion = wMc_close.minus(wMc_open);
  std::vector<Pose> poses;
  for (int sample = 0; sample < samples; ++sample)
    poses.push_back(wMc_open.plus((sample + 0.5) / samples * motion));
  alignas(64) RTCRayHit16 packet;
  alignas(64) int valid[16];
  for (int row = 0; row < height; row += 4) {
    for (int column = 0; column < width; column += 4) {
      const std::size_t first = centres.first(column, row);
      std::copy_n(&centres.valid[first], 16, valid);
      for (int sample = 0; sample < samples; ++sample) {
        aim(poses[sample], tiles[sample], first, packet);
        scene.intersect(valid, packet);
        for (int k = 0; k < 16; ++k)
          if (valid[k])
            radiance[static_cast<std::size_t>(row + (k >> 2)) * width + column + (k & 3)] += shade(packet, k);
      }
    }
  }
  for (float &value : radiance)
    value /= samples;
}

void ForestRenderer::State::traceTruth(const Pose &wMc, RenderedFrame &frame) const
{
  const int width = options.camera.pinhole.width, height = options.camera.pinhole.height;
  frame.depth.resize(height, width, kNothing);
  frame.trunk_id.resize(height, width, kNothing);
  alignas(64) RTCRayHit16 packet;
  alignas(64) int valid[16];
  for (int row = 0; row < height; row += 4) {
    for (int column = 0; column < width; column += 4) {
      const std::size_t first = centres.first(column, row);
      std::copy_n(&centres.valid[first], 16, valid);
      aim(wMc, centres, first, packet);
      scene.intersect(valid, packet);
      for (int k = 0; k < 16; ++k) {
        if (!valid[k] || packet.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID)
          continue;
        const double depth = packet.ray.tfar[k];
        frame.depth[row + (k >> 2)][column + (k & 3)] =
            depth < kDepthReach ? static_cast<std::uint16_t>(std::lround(1000 * depth)) : kNothing;
        if (packet.hit.geomID[k] == RayScene::kBark) {
          frame.trunk_id[row + (k >> 2)][column + (k & 3)] =
              static_cast<std::uint16_t>(trunkAt(packet.hit.primID[k]).id);
        }
      }
    }
  }
}

ForestRenderer::ForestRenderer(const Forest &forest, const RendererOptions &options)
{
  options.validate();
  m_state = std::make_unique<State>(forest, options);
}

ForestRenderer::~ForestRenderer() = default;

const CameraModel &ForestRenderer::camera() const { return m_state->options.camera; }

void ForestRenderer::render(const Pose &wMc_open, const Pose &wMc_close, RenderedFrame &frame, bool with_truth)
{
  m_state->trace(wMc_open, wMc_close);
  frame.gain = m_state->sensor.expose(m_state->radiance, frame.image);
  frame.depth.resize(0, 0);
  frame.trunk_id.resize(0, 0);
  if (with_truth)
    m_state->traceTruth(wMc_open.plus(0.5 * wMc_close.minus(wMc_open)), frame);
}
} // namespace bole
