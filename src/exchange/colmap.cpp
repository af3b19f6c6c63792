// SPDX-License-Identifier: GPL-2.0-or-later
// COLMAP's text model: camera from world, quaternion w first, the corner of the first pixel at (0, 0).
#include "exchange/exchange.h"

#include "geometry/cylinder.h"

#include <Eigen/Geometry>

#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
std::string toColmapCameras(const MapOfRun &map)
{
  const PinholeCamera &camera = map.camera;
  return fmt::format("# CAMERA_ID, MODEL, WIDTH, HEIGHT, fx, fy, cx, cy\n1 PINHOLE {} {} {:.9g} {:.9g} {:.9g} {:.9g}\n",
                     camera.width, camera.height, camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5);
}

std::string toColmapImages(const MapOfRun &map)
{
  std::string text = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  int id = 0;
  for (const StampedPose &pose : map.trajectory) {
    const Pose cMw = (pose.wMb * map.bMc).inverse();
    const Eigen::Quaterniond q(cMw.R);
    fmt::format_to(std::back_inserter(text), "{} {:.12g} {:.12g} {:.12g} {:.12g} {:.9f} {:.9f} {:.9f} 1 {}.png\n\n",
                   ++id, q.w(), q.x(), q.y(), q.z(), cMw.t.x(), cMw.t.y(), cMw.t.z(), pose.stamp_ns);
  }
  return text;
}

std::string toColmapPoints(const MapOfRun &map)
{
  constexpr int kRound = 24, kUp = 26; // points round a trunk and up it
  std::string text = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  int id = 0;
  for (const TrunkRecord &trunk : map.trunks) {
    const Cylinder cylinder = cylinderOf(trunk);
    for (int up = 0; up < kUp; ++up)
      for (int i = 0; i < kRound; ++i) {
        const double angle = 2 * M_PI * i / kRound;
        const Eigen::Vector3d p = cylinder.foot + (cylinder.top - cylinder.foot) * up / (kUp - 1) +
                                  cylinder.radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
        fmt::format_to(std::back_inserter(text), "{} {:.5f} {:.5f} {:.5f} 213 94 0 0\n", ++id, p.x(), p.y(), p.z());
      }
  }
  return text;
}
} // namespace bole
