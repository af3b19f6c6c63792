// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/pose.h>
#include <bole/vpRobotArDrone.h>

#include <gtest/gtest.h>
#include <limits>
#include <visp3/robot/vpRobotException.h>

namespace bole
{
namespace
{
vpColVector twist(std::initializer_list<double> values) { return vpColVector(std::vector<double>(values)); }

/// x right, y down, z forward of a camera that stands 0.1 m before the body's origin.
vpHomogeneousMatrix ahead()
{
  Eigen::Matrix3d bRc;
  bRc << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return Pose{bRc, {0.1, 0, 0}}.toVisp();
}

TEST(BodyVelocity, TurnsTheCamerasTwistIntoTheBodys)
{
  const Eigen::Vector4d v = bodyVelocity(vpRobot::CAMERA_FRAME, twist({0.1, 0.2, 0.3, 0, 0.4, 0}), ahead(), 1, 1);
  // to the right is -y, down is -z; turning right about the camera, the origin behind it swings to the left
  EXPECT_TRUE(v.isApprox(Eigen::Vector4d(0.3, -0.1 + 0.04, -0.2, -0.4), 1e-12)) << v.transpose();
}

TEST(BodyVelocity, SlowsTheWholeTwistWhereOneComponentIsTooFast)
{
  const Eigen::Vector4d v = bodyVelocity(vpRobot::REFERENCE_FRAME, twist({2, 1, 0, 0, 0, 0}), ahead(), 0.5, 1);
  EXPECT_TRUE(v.isApprox(Eigen::Vector4d(0.5, 0.25, 0, 0), 1e-12)) << v.transpose();
}

TEST(BodyVelocity, RefusesWhatIsNoVelocity)
{
  const auto ask = [](vpRobot::vpControlFrameType frame, const vpColVector &v) {
    return bodyVelocity(frame, v, ahead(), 1, 1);
  };
  EXPECT_THROW(ask(vpRobot::REFERENCE_FRAME, twist({0, 0, 0, 0})), vpRobotException);
  EXPECT_THROW(ask(vpRobot::JOINT_STATE, vpColVector(6, 0.0)), vpRobotException);
  EXPECT_THROW(ask(vpRobot::CAMERA_FRAME, twist({0, 0, std::numeric_limits<double>::quiet_NaN(), 0, 0, 0})),
               vpRobotException);
}
} // namespace
} // namespace bole
