// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What an accelerometer of a small drone is taken for, and the scale that it measures.

namespace bole
{
/// Logarithm of a length that is told over the true length.
struct LogScale
{
  double mean = 0, sigma = 0;
  bool contradicts_prior = false; ///< more than three standard deviations from the scale that was expected
};

namespace accelerometer
{
inline constexpr double kNoise = 0.01;      ///< [m/s^2/sqrt(Hz)]
inline constexpr double kBiasSigma = 0.1;   ///< of the constant bias [m/s^2]
inline constexpr double kBiasWalk = 1e-3;   ///< [m/s^2/sqrt(s)]
inline constexpr double kTiltSigma = 0.005; ///< of roll and pitch of a pose filter, which stand in for gravity [rad]
inline constexpr double kRate = 200; ///< [Hz], of the noise above and that of the gyro: a sample that stands for longer
                                     ///< has its noise for all of it
} // namespace accelerometer
} // namespace bole
