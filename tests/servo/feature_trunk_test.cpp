// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "geometry/so3.h"
#include <bole/vpFeatureTrunk.h>
#include <visp3/core/vpCylinder.h>
#include <visp3/visual_features/vpFeatureBuilder.h>
#include <visp3/visual_features/vpFeaturePoint.h>
#include <visp3/vs/vpServo.h>

namespace
{
using bole::Pose;
using bole::Trunk;

/// Camera of a level drone that looks along x of the world, turned and tipped by \p turn (camera
/// frame).
Pose cameraPose(const Eigen::Vector3d &turn = {0.05, -0.2, 0.1})
{
  Eigen::Matrix3d wRc;
  wRc << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return Pose(wRc * bole::expSo3(turn), Eigen::Vector3d(0.3, -0.2, 1.2));
}

Trunk leaningTrunk() { return {{4, 0.7}, std::log(0.2), {0.05, -0.08}}; }

vpFeatureTrunk featureAt(const Pose &wMc)
{
  vpFeatureTrunk feature;
  feature.buildFrom(leaningTrunk(), wMc);
  return feature;
}

/// The trunk as ViSP's cylinder in the camera frame.
vpCylinder cylinderAt(const Pose &wMc)
{
  const Trunk trunk = leaningTrunk();
  const Eigen::Vector3d point = trunk.axisAt(1), axis = (trunk.axisAt(2) - trunk.axisAt(1)).normalized();
  vpCylinder cylinder(axis.x(), axis.y(), axis.z(), point.x(), point.y(), point.z(), trunk.radius());
  cylinder.track(wMc.inverse().toVisp());
  return cylinder;
}

TEST(vpFeatureTrunk, InteractionAgreesWithCentralDifferencesAtTwoStepSizes)
{
  for (const Eigen::Vector3d &turn : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.05, -0.2, 0.1),
                                      Eigen::Vector3d(-0.4, 0.3, -0.5), Eigen::Vector3d(0.3, 1.2, 0)}) {
    const Pose wMc = cameraPose(turn);
    vpFeatureTrunk feature = featureAt(wMc);
    const vpMatrix L = feature.interaction();
    ASSERT_EQ(L.getRows(), 4u);
    for (unsigned int axis = 0; axis < 6; ++axis) {
      double worst[2] = {0, 0};
      for (int halving = 0; halving < 2; ++halving) {
        const double h = halving ? 0.01 : 0.02;
        bole::Vector6d step = bole::Vector6d::Zero();
        step[axis] = h;
        const vpFeatureTrunk ahead = featureAt(wMc.plus(step)), behind = featureAt(wMc.plus(-step));
        for (unsigned int row = 0; row < 4; ++row) {
          const double slope = (ahead[row] - behind[row]) / (2 * h);
          worst[halving] = std::max(worst[halving], std::abs(slope - L[row][axis]));
        }
      }
      EXPECT_LT(worst[1], 2e-4) << "axis " << axis;
      if (worst[1] > 1e-9) {
        EXPECT_NEAR(worst[0] / worst[1], 4, 0.3) << "axis " << axis;
      }
    }
  }
}

TEST(vpFeatureTrunk, AgreesWithTheInteractionOfThePointsLinesOnTheCylindersLimbs)
{
  // d(rho, theta)/dt = d(rho, theta)/ds * L must be ViSP's L of the limb's line.
  const Pose wMc = cameraPose();
  vpFeatureTrunk feature = featureAt(wMc);
  const vpCylinder cylinder = cylinderAt(wMc);
  for (const auto which : {vpCylinder::line1, vpCylinder::line2}) {
    vpFeatureLine line;
    vpFeatureBuilder::create(line, cylinder, which);
    const vpMatrix L_line = line.interaction();
    const auto lineOf = [&](const vpFeatureTrunk &trunk) -> Eigen::Vector2d {
      // The border whose plane is the nearer one to this line.
      const Eigen::Vector3d plane =
          Eigen::Vector3d(std::cos(line.getTheta()), std::sin(line.getTheta()), -line.getRho()).normalized();
      const bole::RelativeTrunk relative = trunk.relativeTrunk();
      Eigen::Vector3d normal = relative.borderNormal(bole::Border::left);
      const Eigen::Vector3d right = relative.borderNormal(bole::Border::right);
      normal = std::abs(right.dot(plane)) > std::abs(normal.dot(plane)) ? right : normal;
      normal *= normal.dot(plane) < 0 ? -1 : 1;
      return {-normal.z() / normal.head<2>().norm(), std::atan2(normal.y(), normal.x())};
    };
    EXPECT_NEAR(lineOf(feature)[0], line.getRho(), 1e-9);
    EXPECT_NEAR(std::remainder(lineOf(feature)[1] - line.getTheta(), 2 * M_PI), 0, 1e-9);
    Eigen::Matrix<double, 2, 4> J;
    for (int k = 0; k < 4; ++k) {
      constexpr double h = 1e-5;
      const auto moved = [&](double step) {
        double values[4] = {feature[0], feature[1], feature[2], feature[3]};
        values[k] += step;
        vpFeatureTrunk trunk;
        trunk.buildFrom(values[0], values[1], values[2], values[3], 0.2);
        return lineOf(trunk);
      };
      J.col(k) = (moved(h) - moved(-h)) / (2 * h);
    }
    const vpMatrix L = feature.interaction();
    for (int row = 0; row < 2; ++row) {
      for (unsigned int axis = 0; axis < 6; ++axis) {
        double chained = 0;
        for (int k = 0; k < 4; ++k)
          chained += J(row, k) * L[k][axis];
        EXPECT_NEAR(chained, L_line[row][axis], 1e-6) << "row " << row << " axis " << axis;
      }
    }
  }
}

TEST(vpFeatureTrunk, BuildersFromMapTrackedTrunkAndLinesAgree)
{
  const Pose wMc = cameraPose();
  const vpFeatureTrunk from_map = featureAt(wMc);
  vpFeatureTrunk from_view, from_lines, from_numbers;
  from_view.buildFrom(bole::relativeTrunk(wMc, Pose(), leaningTrunk()), 0.2);
  vpFeatureLine one, other;
  const vpCylinder cylinder = cylinderAt(wMc);
  vpFeatureBuilder::create(one, cylinder, vpCylinder::line1);
  vpFeatureBuilder::create(other, cylinder, vpCylinder::line2);
  from_lines.buildFrom(other, one, 0.2);
  from_numbers.buildFrom(from_map[0], from_map[1], from_map[2], from_map[3], 0.2);
  for (unsigned int k = 0; k < 4; ++k) {
    EXPECT_NEAR(from_view[k], from_map[k], 1e-12);
    EXPECT_NEAR(from_lines[k], from_map[k], 1e-9);
    EXPECT_NEAR(from_numbers[k], from_map[k], 1e-12);
  }
  EXPECT_NEAR(from_map.relativeTrunk().minus(from_view.relativeTrunk()).norm(), 0, 1e-9);
}

TEST(vpFeatureTrunk, OfATrunkOfTheMapItIsTheSameAsOfTheTrunk)
{
  const Pose wMc = cameraPose();
  bole::TrunkRecord record; // its place is at breast height over the ground
  record.ground_z = -0.4;
  record.xy = leaningTrunk().axisAt(record.ground_z + bole::kBreastHeight).head<2>();
  record.radius = leaningTrunk().radius();
  record.lean = leaningTrunk().lean;
  vpFeatureTrunk feature;
  feature.buildFrom(record, wMc.inverse().toVisp());
  EXPECT_LT(feature.error(featureAt(wMc)).infinityNorm(), 1e-12);
  EXPECT_NEAR(feature.distance(), featureAt(wMc).distance(), 1e-12);
}

TEST(vpFeatureTrunk, LogRatioIgnoresRotationsAndBearingIgnoresRoll)
{
  const vpFeatureTrunk before = featureAt(cameraPose());
  bole::Vector6d turn;
  turn << 0, 0, 0, 0.2, -0.1, 0.3;
  EXPECT_NEAR(featureAt(cameraPose().plus(turn)).logRatio(), before.logRatio(), 1e-12);
  turn << 0, 0, 0, 0, 0, 0.3;
  EXPECT_NEAR(featureAt(cameraPose().plus(turn)).bearing(), before.bearing(), 1e-12);
}

TEST(vpFeatureTrunk, BearingIsPositiveOnTheRightAndInclinationLeansRight)
{
  Trunk trunk;
  trunk.xy = {5, -1}; // y of the world is on the left of a camera that looks along x
  vpFeatureTrunk feature;
  feature.buildFrom(trunk, cameraPose({0, 0, 0}));
  EXPECT_GT(feature.bearing(), 0.1);
  EXPECT_NEAR(feature.inclination(), 0, 1e-12);
  trunk.lean = {0, -0.1};
  feature.buildFrom(trunk, cameraPose({0, 0, 0}));
  EXPECT_GT(feature.inclination(), 0.05);
}

TEST(vpFeatureTrunk, ErrorIsZeroAtItselfAndWrapsAngles)
{
  vpFeatureTrunk a = featureAt(cameraPose()), b;
  EXPECT_EQ(a.error(a).sumSquare(), 0);
  b.buildFrom(3.1, 0, 0, -2, 0.2);
  a.buildFrom(-3.1, 0, 0, -2.5, 0.2);
  const vpColVector e = a.error(b, vpFeatureTrunk::selectBearing() | vpFeatureTrunk::selectLogRatio());
  ASSERT_EQ(e.size(), 2u);
  EXPECT_NEAR(e[0], 2 * M_PI - 6.2, 1e-12);
  EXPECT_NEAR(e[1], -0.5, 1e-12);
}

TEST(vpFeatureTrunk, RefusesACameraInsideTheTrunkAndOneLineTwice)
{
  Trunk trunk;
  trunk.xy = {0.3, -0.2};
  vpFeatureTrunk feature;
  EXPECT_THROW(feature.buildFrom(trunk, cameraPose()), vpException);
  vpFeatureLine line;
  line.setRhoTheta(0.1, 0.05);
  EXPECT_THROW(feature.buildFrom(line, line, 0.2), vpException);
  EXPECT_THROW(feature.interaction(), vpException);
}

/// Moves a free camera by vpServo for 10 s; returns the last error.
double servoFreely(vpServo &task, Pose &wMc, const Pose &wMc_star, vpFeaturePoint *point)
{
  vpFeatureTrunk s, s_star;
  s.buildFrom(leaningTrunk(), wMc);
  s_star.buildFrom(leaningTrunk(), wMc_star);
  task.setServo(vpServo::EYEINHAND_CAMERA);
  task.setInteractionMatrixType(vpServo::CURRENT);
  task.setLambda(1);
  task.addFeature(s, s_star);
  vpFeaturePoint point_star;
  const Eigen::Vector3d landmark(4, -0.5, 1.4);
  const auto view = [&](vpFeaturePoint &p, const Pose &pose) {
    const Eigen::Vector3d c = pose.inverse() * landmark;
    p.buildFrom(c.x() / c.z(), c.y() / c.z(), c.z());
  };
  if (point) {
    view(*point, wMc);
    view(point_star, wMc_star);
    task.addFeature(*point, point_star);
  }
  for (int k = 0; k < 300; ++k) {
    s.buildFrom(leaningTrunk(), wMc);
    if (point)
      view(*point, wMc);
    const vpColVector v = task.computeControlLaw();
    bole::Vector6d step;
    for (int n = 0; n < 6; ++n)
      step[n] = v[n] / 30;
    wMc = wMc.plus(step);
  }
  return task.getError().infinityNorm();
}

TEST(vpFeatureTrunk, ServoesInVpServoAloneAndWithAnotherFeature)
{
  const Pose wMc_star(cameraPose({0, 0.05, 0}).R, Eigen::Vector3d(1.5, 0.4, 1.3));
  {
    vpServo task;
    Pose wMc = cameraPose();
    EXPECT_LT(servoFreely(task, wMc, wMc_star, nullptr), 1e-3);
  }
  vpServo task;
  vpFeaturePoint point;
  Pose wMc = cameraPose();
  EXPECT_LT(servoFreely(task, wMc, wMc_star, &point), 1e-3);
}
} // namespace
