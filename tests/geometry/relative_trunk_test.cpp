// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include <bole/camera.h>
#include <bole/trunk.h>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <visp3/core/vpCylinder.h>

namespace
{
using namespace bole;

const Pose kBodyToCamera((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished(), {0.1, 0.02, -0.03});

Pose tiltedBody() { return Pose(expSo3({0.1, -0.2, 0.4}), {1.0, -0.5, 1.3}); }

Trunk leaningTrunk()
{
  Trunk trunk;
  trunk.xy = {5.0, 1.0};
  trunk.log_radius = std::log(0.2);
  trunk.lean = {0.03, -0.05};
  return trunk;
}

template <int N> Eigen::Matrix<double, 4, N> differences(double h)
{
  Eigen::Matrix<double, 4, N> J;
  for (int i = 0; i < N; ++i) {
    Eigen::Matrix<double, N, 1> step = Eigen::Matrix<double, N, 1>::Zero();
    step(i) = h;
    const RelativeTrunk centre = relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk());
    RelativeTrunk plus, minus;
    if constexpr (N == 6) {
      plus = relativeTrunk(tiltedBody().plus(step), kBodyToCamera, leaningTrunk());
      minus = relativeTrunk(tiltedBody().plus(-step), kBodyToCamera, leaningTrunk());
    }
    else {
      plus = relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk().plus(step));
      minus = relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk().plus(-step));
    }
    J.col(i) = (plus.minus(centre) - minus.minus(centre)) / (2 * h);
  }
  return J;
}

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
  relativeTrunk(tiltedBody(), kBodyToCamera, leaningTrunk(), &J_pose, &J_trunk);
  const double error_pose = (differences<6>(2e-3) - J_pose).norm();
  const double error_trunk = (differences<5>(2e-3) - J_trunk).norm();
  EXPECT_LT(error_pose, 1e-4);
  EXPECT_LT(error_trunk, 1e-4);
  // the error of central differences falls with the square of the step
  EXPECT_NEAR(error_pose / (differences<6>(1e-3) - J_pose).norm(), 4, 0.3);
  EXPECT_NEAR(error_trunk / (differences<5>(1e-3) - J_trunk).norm(), 4, 0.3);
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

TEST(RelativeTrunk, BordersAreTheLimbsOfVispsCylinder)
{
  const Pose wMc = tiltedBody() * kBodyToCamera;
  const RelativeTrunk relative = relativeTrunk(wMc, Pose(), leaningTrunk());
  const Eigen::Vector3d axis = Eigen::Vector3d(0.03, -0.05, 1).normalized();
  vpCylinder cylinder(axis.x(), axis.y(), axis.z(), 5.0, 1.0, 0.0, 0.2);
  cylinder.changeFrame(wMc.inverse().toVisp());
  cylinder.projection();
  const auto distance = [](double rho, double theta, const Eigen::Vector3d &n) {
    Eigen::Vector3d line(std::cos(theta), std::sin(theta), -rho);
    line.normalize();
    return std::min((line - n).norm(), (line + n).norm());
  };
  const auto nearest = [&](const Eigen::Vector3d &n) {
    return std::min(distance(cylinder.getRho1(), cylinder.getTheta1(), n),
                    distance(cylinder.getRho2(), cylinder.getTheta2(), n));
  };
  EXPECT_LT(nearest(relative.borderNormal(Border::left)), 1e-9);
  EXPECT_LT(nearest(relative.borderNormal(Border::right)), 1e-9);
  EXPECT_GT((relative.borderNormal(Border::left) - relative.borderNormal(Border::right)).norm(), 0.1);
}

TEST(RelativeTrunk, LeftBorderIsLeftInTheImage)
{
  const PinholeCamera camera;
  Trunk trunk;
  trunk.xy = {4, 0.3};
  const RelativeTrunk relative = relativeTrunk(Pose(Eigen::Matrix3d::Identity(), {0, 0, 1.2}), kBodyToCamera, trunk);
  EXPECT_LT(camera.project(relative.borderDirection(Border::left, 0)).x(),
            camera.project(relative.borderDirection(Border::right, 0)).x());
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
