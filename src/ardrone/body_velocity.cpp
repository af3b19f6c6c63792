// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/vpRobotArDrone.h>

#include <cmath>
#include <visp3/core/vpVelocityTwistMatrix.h>
#include <visp3/robot/vpRobotException.h>

namespace bole
{
Eigen::Vector4d bodyVelocity(vpRobot::vpControlFrameType frame, const vpColVector &velocity,
                             const vpHomogeneousMatrix &bMc, double translation_max, double rotation_max)
{
  if (velocity.size() != 6)
    throw vpRobotException(vpRobotException::dimensionError, "velocity of %u numbers, must be 6", velocity.size());
  if (frame != vpRobot::CAMERA_FRAME && frame != vpRobot::REFERENCE_FRAME)
    throw vpRobotException(vpRobotException::wrongStateError, "frame, must be CAMERA_FRAME or REFERENCE_FRAME");
  for (unsigned i = 0; i < 6; ++i)
    if (!std::isfinite(velocity[i]))
      throw vpRobotException(vpRobotException::wrongStateError, "velocity %u is not finite", i);
  vpColVector most(6, translation_max);
  most[3] = most[4] = most[5] = rotation_max;
  vpColVector body = vpRobot::saturateVelocities(velocity, most, false);
  if (frame == vpRobot::CAMERA_FRAME)
    body = vpVelocityTwistMatrix(bMc) * body;
  return {body[0], body[1], body[2], body[5]};
}

vpMatrix quadrotorJacobian()
{
  vpMatrix jacobian(6, 4);
  jacobian[0][0] = jacobian[1][1] = jacobian[2][2] = jacobian[5][3] = 1;
  return jacobian;
}

vpColVector motionBetween(const Pose &from, const Pose &to)
{
  const Vector6d moved = to.minus(from);
  vpColVector q(6);
  for (unsigned i = 0; i < 6; ++i)
    q[i] = moved[i];
  return q;
}
} // namespace bole
