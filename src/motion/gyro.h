// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Rotation of the body between two stamps from its gyro, with a covariance that knows the bias,
/// and the bias itself, learnt from rotations that are better than the gyro's.
///
/// Idea: over a frame the white noise of a MEMS gyro averages out and what is left is its bias (0.2
/// to 0.6 deg/s on the rendered flights). So the bias is a state with a covariance: every rotation
/// says how much of its uncertainty is common to all of them, and a rotation refined by points
/// gives the bias back.
///
/// Laws (each a test): a constant rate over dt integrates to Exp(rate dt); rotations of adjoining
/// intervals multiply; refining with the rotation that the gyro itself gave leaves the bias where
/// it was.

#include "geometry/so3.h"
#include <bole/frame.h>

#include <cstdint>
#include <optional>
#include <vector>

namespace bole
{
constexpr double kBiasWalk = 1e-4; ///< of the gyro [rad/s/sqrt(s)]
constexpr double kMostGap_s = 0.1; ///< a longer gap between samples is not bridged as known

struct GyroOptions
{
  /// White noise of the rate [rad/s/sqrt(Hz)], > 0. Measured on the rendered flights: 0.0022 rad/s
  /// over 0.1 s.
  double noise_density = 8e-4;
  /// Standard deviation of the unknown bias at the start [rad/s], >= 0.
  double bias_sigma = 0.008;
};

/// Bias of the gyro [rad/s] in the body frame.
struct GyroBias
{
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();

  static GyroBias unknown(const GyroOptions &options);
};

/// Rotation b0Rb1 of the body over an interval, covariance in the right tangent of b0Rb1.
struct GyroRotation
{
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d white = Eigen::Matrix3d::Zero(); ///< covariance by the white noise and by gaps [rad^2]
  Eigen::Matrix3d bias = Eigen::Matrix3d::Zero();  ///< covariance by the uncertain bias [rad^2]
  double duration = 0;                             ///< [s]
  bool complete = false;                           ///< samples covered the interval without a gap

  Eigen::Matrix3d covariance() const { return white + bias; }
  /// This interval followed by the next one, under the same bias.
  GyroRotation then(const GyroRotation &next) const;
};

/// Integrates \p samples (oldest first; those outside of the interval only help its ends) from \p
/// from_ns to \p to_ns, rates less the bias, linear between samples, held at the ends. Without any
/// sample: identity, not complete, with the covariance of a gap. Cost: 0.1 us a sample in between.
GyroRotation integrateGyro(const std::vector<GyroSample> &samples, std::int64_t from_ns, std::int64_t to_ns,
                           const GyroBias &bias = {}, const GyroOptions &options = {});

/// The rotation from \p from_ns to \p to_ns where samples cover it.
inline std::optional<Eigen::Matrix3d> turnBetween(const std::vector<GyroSample> &samples, std::int64_t from_ns,
                                                  std::int64_t to_ns)
{
  const GyroRotation turned = integrateGyro(samples, from_ns, to_ns);
  return turned.complete ? std::optional<Eigen::Matrix3d>(turned.R) : std::nullopt;
}

/// The rotations between any two stamps, by samples that are integrated once: each costs two look-ups.
class GyroTurns
{
public:
  /// \p samples: oldest first.
  explicit GyroTurns(std::vector<GyroSample> samples);
  /// What turnBetween() says.
  std::optional<Eigen::Matrix3d> between(std::int64_t from_ns, std::int64_t to_ns) const;

private:
  Eigen::Matrix3d turnedUntil(std::int64_t stamp_ns, std::size_t next) const;

  std::vector<GyroSample> m_samples;
  std::vector<Eigen::Matrix3d> m_turned; ///< since the first sample
  std::vector<std::size_t> m_run;        ///< number of the first sample from which on none is missing
};

/// Bias after the rotation \p prior was refined to \p R with the covariance \p covariance [rad^2],
/// the prior having been used in the refinement (a conditional Gaussian: exact to first order).
/// Feed intervals that do not overlap.
GyroBias refineBias(const GyroBias &bias, const GyroRotation &prior, const Eigen::Matrix3d &R,
                    const Eigen::Matrix3d &covariance);
} // namespace bole
