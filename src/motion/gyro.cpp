// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/gyro.h"

#include <Eigen/Dense>

#include <algorithm>

namespace bole
{
namespace
{
constexpr double kGapRateSigma = 0.5; ///< of the rate in such a gap [rad/s]

/// Rate at a stamp: linear between the samples around it, held before the first and after the last.
Eigen::Vector3d rateAt(const std::vector<GyroSample> &samples, std::size_t next, std::int64_t stamp_ns)
{
  if (next == 0) {
    return samples.front().rate;
  }
  if (next == samples.size()) {
    return samples.back().rate;
  }
  const GyroSample &a = samples[next - 1], &b = samples[next];
  if (b.stamp_ns <= a.stamp_ns) {
    return b.rate;
  }
  const double along = double(stamp_ns - a.stamp_ns) / double(b.stamp_ns - a.stamp_ns);
  return a.rate + along * (b.rate - a.rate);
}

/// Longest time without a sample within the interval [s].
double longestGap(const std::vector<GyroSample> &samples, std::int64_t from_ns, std::int64_t to_ns)
{
  std::int64_t gap_ns = 0, previous = from_ns;
  for (const GyroSample &sample : samples) {
    if (sample.stamp_ns <= from_ns) {
      continue;
    }
    const std::int64_t stamp = std::min(sample.stamp_ns, to_ns);
    gap_ns = std::max(gap_ns, stamp - previous);
    previous = stamp;
  }
  return 1e-9 * double(std::max(gap_ns, to_ns - previous));
}
} // namespace

GyroBias GyroBias::unknown(const GyroOptions &options)
{
  return {Eigen::Vector3d::Zero(), options.bias_sigma * options.bias_sigma * Eigen::Matrix3d::Identity()};
}

GyroRotation GyroRotation::then(const GyroRotation &next) const
{
  GyroRotation both;
  both.R = R * next.R;
  both.white = next.R.transpose() * white * next.R + next.white;
  both.duration = duration + next.duration;
  // One bias for both: its standard deviation grows with the time, not with its root.
  const double scale = duration + next.duration;
  both.bias = duration > next.duration
                  ? Eigen::Matrix3d(bias * (scale * scale / std::max(1e-18, duration * duration)))
                  : Eigen::Matrix3d(next.bias * (scale * scale / std::max(1e-18, next.duration * next.duration)));
  both.complete = complete && next.complete;
  return both;
}

GyroRotation integrateGyro(const std::vector<GyroSample> &samples, std::int64_t from_ns, std::int64_t to_ns,
                           const GyroBias &bias, const GyroOptions &options)
{
  GyroRotation result;
  result.duration = 1e-9 * double(to_ns - from_ns);
  const double dt_all = result.duration;
  const double gap = samples.empty() ? dt_all : longestGap(samples, from_ns, to_ns);
  result.complete = !samples.empty() && gap <= kMostGap_s;
  result.white = options.noise_density * options.noise_density * dt_all * Eigen::Matrix3d::Identity();
  result.bias = bias.covariance * dt_all * dt_all;
  if (!result.complete) {
    result.white += kGapRateSigma * kGapRateSigma * gap * gap * Eigen::Matrix3d::Identity();
  }
  if (samples.empty()) {
    return result;
  }
  std::size_t next = 0;
  while (next < samples.size() && samples[next].stamp_ns <= from_ns) {
    ++next;
  }
  std::int64_t stamp = from_ns;
  while (stamp < to_ns) {
    const std::int64_t end = next < samples.size() ? std::min(samples[next].stamp_ns, to_ns) : to_ns;
    const Eigen::Vector3d rate = 0.5 * (rateAt(samples, next, stamp) + rateAt(samples, next, end));
    result.R = result.R * expSo3((rate - bias.mean) * (1e-9 * double(end - stamp)));
    stamp = end;
    ++next;
    next = std::min(next, samples.size());
  }
  result.R = orthonormalized(result.R);
  return result;
}

GyroBias refineBias(const GyroBias &bias, const GyroRotation &prior, const Eigen::Matrix3d &R,
                    const Eigen::Matrix3d &covariance, const GyroOptions &options)
{
  // phi = -duration * (error of the bias) + white noise: the gain carries what was learnt of phi to
  // the bias.
  const Eigen::Vector3d phi = logSo3(prior.R.transpose() * R);
  const Eigen::Matrix3d prior_covariance = prior.covariance();
  const Eigen::Matrix3d gain =
      -prior.duration * bias.covariance * prior_covariance.ldlt().solve(Eigen::Matrix3d::Identity());
  GyroBias refined;
  refined.mean = bias.mean + gain * phi;
  refined.covariance = bias.covariance - gain * (prior_covariance - covariance) * gain.transpose();
  refined.covariance = 0.5 * (refined.covariance + refined.covariance.transpose()).eval();
  refined.covariance += options.bias_walk * options.bias_walk * prior.duration * Eigen::Matrix3d::Identity();
  return refined;
}
} // namespace bole
