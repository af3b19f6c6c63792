// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A velocity as ViSP's robots take it, brought to the four numbers that a quadrotor obeys.

#include <bole/pose.h>

#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/robot/vpRobot.h>

namespace bole
{
/// vx, vy, vz [m/s] and wz [rad/s] of the body (x forward, y left, z up). \p velocity is a twist (vx, vy, vz, wx, wy,
/// wz) of the camera (vpRobot::CAMERA_FRAME) or of the body (vpRobot::REFERENCE_FRAME); as vpRobot does, the whole of
/// it is slowed until no linear component exceeds \p translation_max [m/s] and no angular one \p rotation_max [rad/s].
/// wx and wy of the body, which a quadrotor needs for its own balance, are dropped.
///
/// \throw vpRobotException on another length than 6, another frame, or numbers that are not finite.
Eigen::Vector4d bodyVelocity(vpRobot::vpControlFrameType frame, const vpColVector &velocity,
                             const vpHomogeneousMatrix &bMc, double translation_max, double rotation_max);

/// vpRobot::get_eJe() of a quadrotor, 6x4: its columns are vx, vy, vz and wz.
vpMatrix quadrotorJacobian();
/// From \p from to \p to as vpRobot tells it: translation and theta u in the frame of \p from.
vpColVector motionBetween(const Pose &from, const Pose &to);
} // namespace bole
