// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the accelerometer and the pose filter of a small drone are taken for, and the scale that they measure.

namespace bole
{
/// Logarithm of a length that is told over the true length.
struct LogScale
{
  double mean = 0, sigma = 0;
};

namespace accelerometer
{
inline constexpr double kNoise = 0.01;      ///< [m/s^2/sqrt(Hz)]
inline constexpr double kBiasSigma = 0.1;   ///< of the constant bias [m/s^2]
inline constexpr double kFaultSigma = 1;    ///< ... of one that is broken [m/s^2]
inline constexpr double kBiasWalk = 1e-3;   ///< [m/s^2/sqrt(s)]
inline constexpr double kTiltSigma = 0.005; ///< of roll and pitch of a pose filter, which stand in for gravity [rad]
inline constexpr double kRate = 200; ///< [Hz], of the noise above and that of the gyro: a sample that stands for longer
                                     ///< has its noise for all of it
} // namespace accelerometer

/// Errors between two poses of a pose filter. Measured on the rendered flights (120 frames of 0.1 s, three seeds): in
/// the horizontal plane they walk; height and attitude have white noise.
namespace odometry
{
inline constexpr double kWalk = 0.038;         ///< horizontal [m/sqrt(s)]
inline constexpr double kHeightSigma = 0.03;   ///< [m]
inline constexpr double kRelativeSigma = 0.03; ///< in proportion to the way: scale, heading
inline constexpr double kTurnSigma = 0.007;    ///< [rad]

/// Of the direction of a way of \p length [m] in \p duration [s], an axis [rad^2]
inline double directionVariance(double length, double duration)
{
  return (kWalk * kWalk * duration + kHeightSigma * kHeightSigma) / (length * length) + kRelativeSigma * kRelativeSigma;
}
} // namespace odometry
} // namespace bole
