// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/cylinder.h>

#include <Eigen/Geometry>

#include <limits>

namespace bole
{
using Eigen::Vector3d;

Cylinder operator*(const Pose &aMb, const Cylinder &b)
{
  Cylinder a = b;
  a.foot = aMb * b.foot;
  a.top = aMb * b.top;
  return a;
}

Cylinder cylinderOf(const Trunk &trunk, double foot_z, double top_z, const std::string &name)
{
  return {trunk.axisAt(foot_z), trunk.axisAt(top_z), trunk.radius(), name};
}

Cylinder cylinderOf(const TrunkRecord &trunk)
{
  constexpr double kLow = 0.1, kHigh = 2.6; // over the ground [m]
  const auto axisAt = [&trunk](double height) {
    const Eigen::Vector2d xy = trunk.xy + (height - kBreastHeight) * trunk.lean;
    return Vector3d(xy.x(), xy.y(), trunk.ground_z + height);
  };
  return {axisAt(kLow), axisAt(kHigh), trunk.radius, "trunk_" + std::to_string(trunk.id)};
}

RelativeTrunk relativeTrunk(const Cylinder &c)
{
  const Vector3d axis = c.axis();
  const Vector3d nearest = c.foot - axis.dot(c.foot) * axis;
  const double d = nearest.norm();
  RelativeTrunk relative;
  if (!(d > 0)) {
    relative.log_ratio = std::numeric_limits<double>::infinity();
    return relative;
  }
  relative.cRt.col(0) = nearest / d;
  relative.cRt.col(2) = axis;
  relative.cRt.col(1) = axis.cross(relative.cRt.col(0));
  relative.log_ratio = std::log(c.radius / d);
  return relative;
}

ContactLine contactLine(const Cylinder &c, const RelativeTrunk &relative, Border border)
{
  const Vector3d out = c.radius * relative.borderNormal(border);
  return {c.foot + out, c.top + out};
}
} // namespace bole
