// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include <bole/vpFeatureTrunk.h>

#include <Eigen/Geometry>

#include <cmath>
#include <cstdio>
#include <visp3/core/vpDisplay.h>

namespace
{
using Eigen::Vector3d;

/// Columns: m (towards the axis), n (left), a (axis, up), in the camera frame:
/// bole::RelativeTrunk::cRt.
Eigen::Matrix3d frameOf(double bearing, double inclination, double tip)
{
  const Vector3d a(std::cos(tip) * std::sin(inclination), -std::cos(tip) * std::cos(inclination), std::sin(tip));
  const Vector3d forward = (Vector3d::UnitZ() - a.z() * a).normalized(); // optical axis across the trunk
  const Vector3d left = a.cross(forward);
  const Vector3d m = std::cos(bearing) * forward - std::sin(bearing) * left;
  Eigen::Matrix3d cRt;
  cRt << m, a.cross(m), a;
  return cRt;
}

template <class Pixel>
void displayBorders(const bole::RelativeTrunk &relative, const vpCameraParameters &cam, const vpImage<Pixel> &I,
                    const vpColor &color, unsigned int thickness)
{
  if (relative.log_ratio >= 0)
    return;
  for (bole::Border border : {bole::Border::left, bole::Border::right}) {
    const Vector3d low = relative.borderDirection(border, -0.5), high = relative.borderDirection(border, 1.0);
    if (low.z() <= 0.05 || high.z() <= 0.05)
      continue;
    const auto pixel = [&cam](const Vector3d &d) {
      return vpImagePoint(cam.get_py() * d.y() / d.z() + cam.get_v0(), cam.get_px() * d.x() / d.z() + cam.get_u0());
    };
    vpDisplay::displayLine(I, pixel(low), pixel(high), color, thickness);
  }
}

/// Unit normal of the plane through the camera's centre and an image line x cos(theta) + y sin(theta) = rho.
Vector3d planeOf(const vpFeatureLine &line)
{
  return Vector3d(std::cos(line.getTheta()), std::sin(line.getTheta()), -line.getRho()).normalized();
}
} // namespace

vpFeatureTrunk::vpFeatureTrunk() { init(); }

void vpFeatureTrunk::init()
{
  dim_s = 4;
  nbParameters = 1;
  s.resize(dim_s);
  s[3] = std::log(0.05);
  if (!flags)
    flags = new bool[nbParameters];
  resetFlags();
}

void vpFeatureTrunk::set(const bole::RelativeTrunk &relative)
{
  const Vector3d m = relative.cRt.col(0), n = relative.cRt.col(1), a = relative.cRt.col(2);
  s[0] = std::atan2(n.z(), m.z());
  s[1] = std::atan2(a.x(), -a.y());
  s[2] = std::atan2(a.z(), std::hypot(a.x(), a.y()));
  s[3] = relative.log_ratio;
  flags[0] = true;
}

void vpFeatureTrunk::buildFrom(const bole::RelativeTrunk &relative, double radius)
{
  if (!relative.isFinite() || !(radius > 0))
    throw bole::badValue("r/d = {}, radius = {}, must be below 1 and above 0", relative.ratio(), radius);
  m_radius = radius;
  set(relative);
}

void vpFeatureTrunk::buildFrom(const bole::Trunk &trunk, const bole::Pose &wMc)
{
  buildFrom(bole::relativeTrunk(wMc, bole::Pose(), trunk), trunk.radius());
}

void vpFeatureTrunk::buildFrom(const bole::TrunkRecord &trunk, const vpHomogeneousMatrix &cMw)
{
  const double breast_z = trunk.ground_z + bole::kBreastHeight; // where the record has its place
  buildFrom(bole::Trunk{trunk.xy - breast_z * trunk.lean, std::log(trunk.radius), trunk.lean},
            bole::Pose::fromVisp(cMw).inverse());
}

void vpFeatureTrunk::buildFrom(const vpFeatureLine &border, const vpFeatureLine &other_border, double radius)
{
  Vector3d one = planeOf(border), other = planeOf(other_border);
  Vector3d axis = one.cross(other); // in both planes
  if (axis.norm() < 1e-9)
    throw bole::badValue("border lines = one line twice, must be two");
  axis.normalize();
  axis = axis.y() > 0 ? Vector3d(-axis) : axis;
  // Directions in the planes, across the axis, in front of the camera; the trunk is between them.
  Vector3d to_one = axis.cross(one), to_other = axis.cross(other);
  to_one = to_one.z() < 0 ? Vector3d(-to_one) : to_one;
  to_other = to_other.z() < 0 ? Vector3d(-to_other) : to_other;
  const Vector3d m = (to_one + to_other).normalized();
  const double ratio = 0.5 * (to_one - to_other).norm(); // sine of half the angle between the borders
  if (!(ratio < 1) || !m.allFinite())
    throw bole::badValue("r/d = {}, must be below 1", ratio);
  bole::RelativeTrunk relative;
  relative.cRt << m, axis.cross(m), axis;
  relative.log_ratio = std::log(ratio);
  buildFrom(relative, radius);
}

void vpFeatureTrunk::buildFrom(double bearing, double inclination, double tip, double log_ratio, double radius)
{
  bole::RelativeTrunk relative;
  relative.cRt = frameOf(bearing, inclination, tip);
  relative.log_ratio = log_ratio;
  buildFrom(relative, radius);
}

double vpFeatureTrunk::distance() const { return m_radius * std::exp(-s[3]); }

bole::RelativeTrunk vpFeatureTrunk::relativeTrunk() const
{
  bole::RelativeTrunk relative;
  relative.cRt = frameOf(s[0], s[1], s[2]);
  relative.log_ratio = s[3];
  return relative;
}

/// With a' = -w x a for the axis and m' = -n (n.v) / d - w x m for the line of sight, see the header.
vpMatrix vpFeatureTrunk::interaction(unsigned int select)
{
  if (!flags[0])
    throw bole::notInitialized("vpFeatureTrunk: buildFrom() must come before interaction()");
  const Eigen::Matrix3d cRt = frameOf(s[0], s[1], s[2]);
  const Vector3d m = cRt.col(0), n = cRt.col(1), a = cRt.col(2);
  const double across = m.z() * m.z() + n.z() * n.z(), flat = a.x() * a.x() + a.y() * a.y();
  Eigen::Matrix<double, 4, 6> L = Eigen::Matrix<double, 4, 6>::Zero();
  L.row(0) << n.transpose() / distance(), (a - a.z() / across * (m.z() * m + n.z() * n)).transpose();
  // a' = [a]x w: rows of the skew matrix of a.
  const Vector3d ax(0, -a.z(), a.y()), ay(a.z(), 0, -a.x()), az(-a.y(), a.x(), 0);
  L.block<1, 3>(1, 3) = ((a.x() * ay - a.y() * ax) / flat).transpose();
  L.block<1, 3>(2, 3) = (az / std::sqrt(flat)).transpose();
  L.block<1, 3>(3, 0) = m.transpose() / distance();

  vpMatrix result(0, 6);
  for (unsigned int row = 0; row < 4; ++row) {
    if (select & FEATURE_LINE[row]) {
      vpMatrix line(1, 6);
      for (unsigned int k = 0; k < 6; ++k)
        line[0][k] = L(row, k);
      result.stack(line);
    }
  }
  return result;
}

vpColVector vpFeatureTrunk::error(const vpBasicFeature &s_star, unsigned int select)
{
  vpColVector e;
  for (unsigned int k = 0; k < 4; ++k) {
    if (select & FEATURE_LINE[k]) {
      const double difference = s[k] - s_star[k];
      e.stack(k < 3 ? std::remainder(difference, 2 * M_PI) : difference);
    }
  }
  return e;
}

void vpFeatureTrunk::print(unsigned int select) const
{
  const char *names[] = {"bearing", "inclination", "tip", "log r/d"};
  std::printf("Trunk:");
  for (unsigned int k = 0; k < 4; ++k)
    if (select & FEATURE_LINE[k])
      std::printf(" %s = %g", names[k], s[k]);
  std::printf("\n");
}

vpFeatureTrunk *vpFeatureTrunk::duplicate() const { return new vpFeatureTrunk; }

void vpFeatureTrunk::display(const vpCameraParameters &cam, const vpImage<unsigned char> &I, const vpColor &color,
                             unsigned int thickness) const
{
  displayBorders(relativeTrunk(), cam, I, color, thickness);
}

void vpFeatureTrunk::display(const vpCameraParameters &cam, const vpImage<vpRGBa> &I, const vpColor &color,
                             unsigned int thickness) const
{
  displayBorders(relativeTrunk(), cam, I, color, thickness);
}
