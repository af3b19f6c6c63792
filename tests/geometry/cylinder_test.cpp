// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include <bole/cylinder.h>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <visp3/core/vpCylinder.h>

namespace
{
using namespace bole;
using Eigen::Vector3d;

/// Distance, up to sign, of the unit normal \p n from the plane of the image line rho = x cos + y sin.
double planeDistance(double rho, double theta, const Vector3d &n)
{
  const Vector3d line = Vector3d(std::cos(theta), std::sin(theta), -rho).normalized();
  return std::min((line - n).norm(), (line + n).norm());
}

TEST(Cylinder, BordersAreTheLimbsOfVispForAnyDirectionOfTheAxis)
{
  for (const Vector3d &axis :
       {Vector3d(0, -1, 0), Vector3d(0.8, -0.5, 0.1), Vector3d(1, 0.2, -0.3), Vector3d(0.1, 0.9, 0.4)}) {
    Cylinder c; // in the camera frame
    c.foot = {0.4, 0.7, 3};
    c.top = c.foot + 1.7 * axis.normalized();
    c.radius = 0.25;
    vpCylinder visp(c.axis().x(), c.axis().y(), c.axis().z(), c.foot.x(), c.foot.y(), c.foot.z(), c.radius);
    visp.changeFrame(vpHomogeneousMatrix());
    visp.projection();
    const RelativeTrunk relative = relativeTrunk(c);
    for (const Border border : {Border::left, Border::right}) {
      const Vector3d n = relative.borderNormal(border);
      EXPECT_LT(std::min(planeDistance(visp.getRho1(), visp.getTheta1(), n),
                         planeDistance(visp.getRho2(), visp.getTheta2(), n)),
                1e-9)
          << axis.transpose();
    }
  }
}

TEST(Cylinder, AlongATrunkItIsTheRelativeTrunkOfThatTrunk)
{
  Trunk trunk;
  trunk.xy = {4, -1};
  trunk.log_radius = std::log(0.18);
  trunk.lean = {0.05, -0.03};
  const Pose wMc((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished() * expSo3({0.1, 0.2, -0.1}),
                 {0.5, 0.3, 1.4});
  Cylinder c;
  c.foot = trunk.axisAt(0);
  c.top = trunk.axisAt(2.6);
  c.radius = trunk.radius();
  EXPECT_LT(relativeTrunk(wMc.inverse() * c).minus(relativeTrunk(wMc, Pose(), trunk)).norm(), 1e-9);
}

TEST(Cylinder, AContactLineLiesOnTheBarkAndInTheSilhouettePlane)
{
  Cylinder c;
  c.foot = {0.4, 0.7, 3};
  c.top = {0.5, -1, 3.2};
  c.radius = 0.25;
  const RelativeTrunk relative = relativeTrunk(c);
  for (const Border border : {Border::left, Border::right}) {
    const ContactLine line = contactLine(c, relative, border);
    for (const Vector3d &p : {line.foot, line.top, Vector3d(0.3 * line.foot + 0.7 * line.top)}) {
      EXPECT_NEAR((p - c.foot).cross(c.axis()).norm(), c.radius, 1e-12); // on the bark
      EXPECT_NEAR(p.dot(relative.borderNormal(border)), 0, 1e-12);       // in the plane through the camera
    }
  }
}

TEST(Cylinder, MovesWithItsFrame)
{
  const Pose aMb(expSo3({0.3, -0.7, 1.2}), {1, -2, 0.5});
  Cylinder c;
  c.foot = {1, 0, 2};
  c.top = {1, 0.2, 4};
  c.radius = 0.1;
  const Cylinder moved = aMb * c;
  EXPECT_LT((moved.axis() - aMb.R * c.axis()).norm(), 1e-12);
  EXPECT_LT((moved.foot - aMb * c.foot).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(moved.radius, 0.1);
}

TEST(Cylinder, RoundTheCameraIsNoRelativeTrunk)
{
  Cylinder c;
  c.foot = {0.05, -1, 0};
  c.top = {0.05, 1, 0};
  c.radius = 0.1;
  EXPECT_FALSE(relativeTrunk(c).isFinite());
  c.foot.x() = c.top.x() = 0;
  EXPECT_FALSE(relativeTrunk(c).isFinite());
}
} // namespace
