// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/differences.h"

#include "geometry/silhouette.h"
#include "geometry/so3.h"
#include <bole/camera.h>
#include <bole/cylinder.h>
#include <bole/trunk.h>
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
    const Vector3d foot(0.4, 0.7, 3);
    const Cylinder c{foot, foot + 1.7 * axis.normalized(), 0.25, ""}; // in the camera frame
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
  const Trunk trunk{{4, -1}, std::log(0.18), {0.05, -0.03}};
  const Pose wMc((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished() * expSo3({0.1, 0.2, -0.1}),
                 {0.5, 0.3, 1.4});
  const Cylinder c{trunk.axisAt(0), trunk.axisAt(2.6), trunk.radius(), ""};
  EXPECT_LT(relativeTrunk(wMc.inverse() * c).minus(relativeTrunk(wMc, Pose(), trunk)).norm(), 1e-9);
}

TEST(Cylinder, AContactLineLiesOnTheBarkAndInTheSilhouettePlane)
{
  const Cylinder c{{0.4, 0.7, 3}, {0.5, -1, 3.2}, 0.25, ""};
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
  const Cylinder c{{1, 0, 2}, {1, 0.2, 4}, 0.1, ""};
  const Cylinder moved = aMb * c;
  EXPECT_LT((moved.axis() - aMb.R * c.axis()).norm(), 1e-12);
  EXPECT_LT((moved.foot - aMb * c.foot).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(moved.radius, 0.1);
}

TEST(Cylinder, RoundTheCameraIsNoRelativeTrunk)
{
  Cylinder c{{0.05, -1, 0}, {0.05, 1, 0}, 0.1, ""};
  EXPECT_FALSE(relativeTrunk(c).isFinite());
  c.foot.x() = c.top.x() = 0;
  EXPECT_FALSE(relativeTrunk(c).isFinite());
}

/// A trunk 4 m ahead along x of a camera frame whose z is up, turned by \p R.
RelativeTrunk ahead(const Eigen::Matrix3d &R = Eigen::Matrix3d::Identity())
{
  return relativeTrunk(Cylinder{R * Vector3d(4, 0, -1), R * Vector3d(4, 0, 3), 0.3, ""});
}

Vector3d bearing(double angle, double tan_elevation = 0) { return {std::cos(angle), std::sin(angle), tan_elevation}; }

TEST(Silhouette, HalfWidthIsTheAngleToATangent)
{
  EXPECT_NEAR(std::sin(silhouetteHalfWidth(0.3, 4)), 0.3 / 4, 1e-15);
  EXPECT_NEAR(silhouetteHalfWidth(0.3, 0.1), std::asin(0.99), 1e-15);
}

TEST(Silhouette, CoversTheBearingsWithinItsHalfWidthAndTheMargin)
{
  for (const Eigen::Matrix3d &R : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), expSo3({0.4, -0.7, 0.2})})
    for (const double margin : {-0.01, 0.0, 0.02}) {
      const double edge = silhouetteHalfWidth(0.3, 4) + margin;
      for (const double side : {-1.0, 1.0}) {
        EXPECT_TRUE(Silhouette(ahead(R), margin).covers(7 * R * bearing(side * (edge - 1e-9), 0.4)));
        EXPECT_FALSE(Silhouette(ahead(R), margin).covers(7 * R * bearing(side * (edge + 1e-9), 0.4)));
      }
    }
}

TEST(Silhouette, CoversNothingBehindTheCameraAboveItsTopOrBelowItsFoot)
{
  EXPECT_FALSE(Silhouette(ahead()).covers(bearing(M_PI)));
  const Silhouette stem(ahead(), 0, -0.25, 0.75);
  EXPECT_TRUE(stem.covers(bearing(0, 0.74)));
  EXPECT_FALSE(stem.covers(bearing(0, 0.76)));
  EXPECT_FALSE(stem.covers(bearing(0, -0.26)));
}

TEST(Cylinder, OfATrunkIsItsAxisBetweenTwoHeights)
{
  const Trunk trunk{{3, -1}, std::log(0.2), {0.1, -0.02}};
  const Cylinder c = cylinderOf(trunk, 0.5, 2.5, "7");
  EXPECT_LT((c.foot - Vector3d(3.05, -1.01, 0.5)).norm(), 1e-12);
  EXPECT_LT((c.top - Vector3d(3.25, -1.05, 2.5)).norm(), 1e-12);
  EXPECT_NEAR(c.radius, 0.2, 1e-15);
  EXPECT_EQ(c.name, "7");
}

const Pose kBodyToCamera((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished(), {0.1, 0.02, -0.03});

Pose tiltedBody() { return Pose(expSo3({0.1, -0.2, 0.4}), {1.0, -0.5, 1.3}); }

Trunk leaningTrunk() { return {{5, 1}, std::log(0.2), {0.03, -0.05}}; }

TEST(RelativeTrunk, BetweenTwoBordersHasThem)
{
  const Eigen::Matrix3d cRl = expSo3({0.3, -0.1, 0.2});
  const RelativeTrunk relative = betweenBorders(cRl, 0.4, 0.1);
  const Eigen::Vector3d left = cRl.transpose() * relative.borderDirection(Border::left, 0.2),
                        right = cRl.transpose() * relative.borderDirection(Border::right, -0.3);
  EXPECT_NEAR(left.y() / left.x(), 0.4, 1e-12);
  EXPECT_NEAR(right.y() / right.x(), 0.1, 1e-12);
}

TEST(RelativeTrunk, JacobiansAgreeWithCentralDifferences)
{
  Matrix46d J_pose;
  Matrix45d J_trunk;
  const RelativeTrunk centre = relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk(), &J_pose, &J_trunk);
  const auto byPose = [&](const Vector6d &xi) {
    return relativeTrunk(tiltedBody().plus(xi), kBodyToCamera, leaningTrunk()).minus(centre);
  };
  const auto byTrunk = [&](const Vector5d &xi) {
    return relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk().plus(xi)).minus(centre);
  };
  test::expectDerivative(byPose, J_pose, 2e-3, 1e-4);
  test::expectDerivative(byTrunk, J_trunk, 2e-3, 1e-4);
}

TEST(RelativeTrunk, EitherJacobianCanBeAskedForAlone)
{
  Matrix46d J_pose, J_pose_alone = Matrix46d::Constant(NAN);
  Matrix45d J_trunk, J_trunk_alone = Matrix45d::Constant(NAN);
  relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk(), &J_pose, &J_trunk);
  relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk(), &J_pose_alone, nullptr);
  relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk(), nullptr, &J_trunk_alone);
  EXPECT_EQ(J_pose_alone, J_pose);
  EXPECT_EQ(J_trunk_alone, J_trunk);
}

TEST(RelativeTrunk, PlusAndMinusAreInverse)
{
  const RelativeTrunk x = relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk());
  const Vector4d step(0.02, -0.03, 0.1, 0.2);
  EXPECT_LT((x.plus(step).minus(x) - step).norm(), 1e-12);
  EXPECT_LT(x.plus(Vector4d::Zero()).minus(x).norm(), 1e-12);
}

TEST(RelativeTrunk, RadiusGivesTheTrunkBack)
{
  Trunk trunk = leaningTrunk();
  trunk.lean.setZero();
  const Pose wMc = tiltedBody() * kBodyToCamera;
  const Trunk back = trunkFromRelative(wMc, relativeTrunk(wMc, Pose(), trunk), 0.2);
  EXPECT_LT(back.minus(trunk).norm(), 1e-9);
}
} // namespace
