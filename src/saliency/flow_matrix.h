// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How an image moves when the camera does (Section 5, Eq. 13 and 14).
///
/// Convention: pixel u of I(t-1) moves to u + v in I(t). For a camera that turns by omega [rad] and advances by
/// t [m], both in the frame of the camera, a static point at depth Z moves by v = V(u) omega + A(u) t / Z to first
/// order. The camera's turn is pRc = Exp(omega), p the previous and c the current camera.
///
/// Laws (each a test): V == f times the rotational block of vpFeaturePoint::interaction(), A / Z == f times its
/// translational block; V and A are the derivatives of the exact warp at no motion, with the sign turned.
///
/// Deviation: Eq. 14 has one focal length; V here has fx and fy and is Eq. 14 where they are equal.

#include <bole/camera.h>

namespace bole
{
using FlowMatrix = Eigen::Matrix<double, 2, 3>;

/// V of Eq. 14 [px/rad].
FlowMatrix flowMatrix(const PinholeCamera &camera, const Eigen::Vector2d &u_px);

/// A [px]: flow A t / Z of a translation of the camera t at depth Z.
FlowMatrix translationFlowMatrix(const PinholeCamera &camera, const Eigen::Vector2d &u_px);
} // namespace bole
