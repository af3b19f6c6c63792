// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where the errors stand in the state of MotionFilter. Attitudes err in the right tangent.

namespace bole::motion_states
{
constexpr int kAttitudeAt = 0, kPlaceAt = 3, kVelocityAt = 6; ///< velocity and place in w
constexpr int kRateAt = 9;                                    ///< of turning, in b
constexpr int kGyroAt = 12, kForceAt = 15;                    ///< biases
constexpr int kMountAt = 18;                                  ///< of the odometry's body, in the right tangent of bRo
constexpr int kScaleAt = 21, kHeightAt = 22;                  ///< log of its horizontal scale, offset of its height
constexpr int kLastVelocityAt = 23;                           ///< at the frame before
constexpr int kCore = 26; ///< from here on attitude and place at the frames before, six each
} // namespace bole::motion_states
