// SPDX-License-Identifier: GPL-2.0-or-later
// Shapes for CAD and for viewers of point clouds and meshes, and the foresters' table.
#include "exchange/exchange.h"

#include <bole/cylinder.h>

#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
namespace
{
constexpr int kSides = 24; // of a trunk's mesh

/// Foot and top ring of the trunk, one after the other.
std::vector<Eigen::Vector3d> ringsOf(const TrunkRecord &trunk)
{
  const Cylinder cylinder = cylinderOf(trunk);
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d &middle : {cylinder.foot, cylinder.top})
    for (int i = 0; i < kSides; ++i) {
      const double angle = 2 * M_PI * i / kSides;
      points.emplace_back(middle + cylinder.radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0));
    }
  return points;
}
} // namespace

std::string toPly(const MapOfRun &map)
{
  std::string text = fmt::format("ply\nformat ascii 1.0\ncomment {}; metres\nelement vertex {}\n"
                                 "property float x\nproperty float y\nproperty float z\n"
                                 "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                 "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                                 describe(map.reference), 2 * kSides * map.trunks.size() + map.trajectory.size(),
                                 kSides * map.trunks.size());
  for (const TrunkRecord &trunk : map.trunks)
    for (const Eigen::Vector3d &p : ringsOf(trunk))
      fmt::format_to(std::back_inserter(text), "{:.5f} {:.5f} {:.5f} 213 94 0\n", p.x(), p.y(), p.z());
  for (const StampedPose &pose : map.trajectory)
    fmt::format_to(std::back_inserter(text), "{:.5f} {:.5f} {:.5f} 0 114 178\n", pose.wMb.t.x(), pose.wMb.t.y(),
                   pose.wMb.t.z());
  for (int k = 0; k < static_cast<int>(map.trunks.size()); ++k)
    for (int i = 0; i < kSides; ++i) {
      const int foot = 2 * kSides * k, next = (i + 1) % kSides;
      fmt::format_to(std::back_inserter(text), "4 {} {} {} {}\n", foot + i, foot + next, foot + kSides + next,
                     foot + kSides + i);
    }
  return text;
}

std::string toDxf(const MapOfRun &map)
{
  std::string text = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n"
                     "0\nSECTION\n2\nTABLES\n0\nTABLE\n2\nLAYER\n70\n3\n";
  constexpr std::pair<const char *, int> kLayers[] = {{"TRUNKS", 1}, {"LABELS", 7}, {"TRAJECTORY", 5}};
  for (const auto &[name, colour] : kLayers)
    text += fmt::format("0\nLAYER\n2\n{}\n70\n0\n62\n{}\n6\nCONTINUOUS\n", name, colour);
  text += "0\nENDTAB\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n";
  for (const TrunkRecord &trunk : map.trunks) {
    const double x = trunk.xy.x(), y = trunk.xy.y(), z = trunk.ground_z + kBreastHeight;
    text +=
        fmt::format("0\nCIRCLE\n8\nTRUNKS\n10\n{:.5f}\n20\n{:.5f}\n30\n{:.5f}\n40\n{:.5f}\n", x, y, z, trunk.radius);
    text += fmt::format("0\nTEXT\n8\nLABELS\n10\n{:.5f}\n20\n{:.5f}\n30\n{:.5f}\n40\n0.2\n1\n{}\n", x + trunk.radius,
                        y + trunk.radius, z, trunk.id);
  }
  text += "0\nPOLYLINE\n8\nTRAJECTORY\n66\n1\n70\n8\n10\n0\n20\n0\n30\n0\n"; // 8: a line in space
  for (const StampedPose &pose : map.trajectory)
    text += fmt::format("0\nVERTEX\n8\nTRAJECTORY\n10\n{:.5f}\n20\n{:.5f}\n30\n{:.5f}\n70\n32\n", pose.wMb.t.x(),
                        pose.wMb.t.y(), pose.wMb.t.z());
  return text + "0\nSEQEND\n8\nTRAJECTORY\n0\nENDSEC\n0\nEOF\n";
}

std::string toInventory(const MapOfRun &map)
{
  std::string text = "tree,x_m,y_m,position_sigma_m,dbh_cm,dbh_sigma_cm,basal_area_m2,lean_deg,lean_towards_deg\n";
  for (const TrunkRecord &trunk : map.trunks) {
    const double towards = std::atan2(trunk.lean.y(), trunk.lean.x()) * 180 / M_PI; // from x, counter-clockwise
    fmt::format_to(std::back_inserter(text), "{},{:.3f},{:.3f},{:.3f},{:.1f},{:.1f},{:.4f},{:.1f},{:.0f}\n", trunk.id,
                   trunk.xy.x(), trunk.xy.y(), trunk.positionSigma(), 200 * trunk.radius, 200 * trunk.radiusSigma(),
                   M_PI * trunk.radius * trunk.radius, std::atan(trunk.lean.norm()) * 180 / M_PI, towards);
  }
  return text;
}
} // namespace bole
