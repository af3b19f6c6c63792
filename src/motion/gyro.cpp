// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/gyro.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr auto kMostGap_ns = static_cast<std::int64_t>(1e9 * kMostGap_s);
constexpr double kRateSigma = 0.5; ///< of a rate that nothing measured [rad/s]
/// Walk of the rate between samples [rad/s/sqrt(s)]: 0.15 to 0.4 between two, 0.2 to 0.5 after the last, measured on
/// the rendered flights over 0.01 to 0.2 s.
constexpr double kRateWalk = 0.3;

/// Rate at a stamp: linear between the samples around it, held before the first and after the last.
Eigen::Vector3d rateAt(const std::vector<GyroSample> &samples, std::size_t next, std::int64_t stamp_ns)
{
  if (next == 0)
    return samples.front().rate;
  if (next == samples.size())
    return samples.back().rate;
  const GyroSample &a = samples[next - 1], &b = samples[next];
  if (b.stamp_ns <= a.stamp_ns)
    return b.rate;
  const double along = double(stamp_ns - a.stamp_ns) / double(b.stamp_ns - a.stamp_ns);
  return a.rate + along * (b.rate - a.rate);
}

/// Number of the first sample after a stamp.
std::size_t firstAfter(const std::vector<GyroSample> &samples, std::int64_t stamp_ns)
{
  const auto isBefore = [](std::int64_t stamp, const GyroSample &sample) { return stamp < sample.stamp_ns; };
  return static_cast<std::size_t>(std::upper_bound(samples.begin(), samples.end(), stamp_ns, isBefore) -
                                  samples.begin());
}

/// What the samples leave open of an interval.
struct Gaps
{
  double longest_s = 0;
  double variance = 0; ///< of the angle, by a rate that walks between the samples [rad^2]
};

/// \p next: number of the first sample after \p from_ns.
Gaps gapsOf(const std::vector<GyroSample> &samples, std::size_t next, std::int64_t from_ns, std::int64_t to_ns)
{
  Gaps gaps;
  const auto add = [&gaps](std::int64_t gap_ns, bool is_between) {
    const double gap_s = 1e-9 * double(gap_ns);
    gaps.longest_s = std::max(gaps.longest_s, gap_s);
    gaps.variance += kRateWalk * kRateWalk * gap_s * gap_s * gap_s / (is_between ? 12 : 3);
  };
  std::int64_t previous = from_ns;
  for (; next < samples.size() && previous < to_ns; ++next) {
    const std::int64_t stamp = std::min(samples[next].stamp_ns, to_ns);
    add(stamp - previous, next > 0);
    previous = stamp;
  }
  add(to_ns - previous, false);
  return gaps;
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
  const GyroRotation &longer = duration > next.duration ? *this : next;
  both.bias = longer.bias * std::pow(both.duration / std::max(1e-9, longer.duration), 2);
  both.complete = complete && next.complete;
  return both;
}

GyroRotation integrateGyro(const std::vector<GyroSample> &samples, std::int64_t from_ns, std::int64_t to_ns,
                           const GyroBias &bias, const GyroOptions &options)
{
  GyroRotation result;
  result.duration = 1e-9 * double(to_ns - from_ns);
  const double dt_all = result.duration;
  std::size_t next = firstAfter(samples, from_ns);
  const Gaps gaps = gapsOf(samples, next, from_ns, to_ns);
  result.complete = !samples.empty() && gaps.longest_s <= kMostGap_s;
  const double open = samples.empty() ? kRateSigma * kRateSigma * dt_all * dt_all : gaps.variance;
  result.white = (options.noise_density * options.noise_density * dt_all + open) * Eigen::Matrix3d::Identity();
  result.bias = bias.covariance * dt_all * dt_all;
  if (samples.empty())
    return result;
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

GyroTurns::GyroTurns(std::vector<GyroSample> samples) : m_samples(std::move(samples))
{
  for (std::size_t i = 0; i < m_samples.size(); ++i) {
    const std::int64_t stamp_ns = m_samples[i].stamp_ns;
    m_turned.push_back(i == 0 ? Eigen::Matrix3d::Identity() : turnedUntil(stamp_ns, i));
    m_run.push_back(i > 0 && stamp_ns - m_samples[i - 1].stamp_ns <= kMostGap_ns ? m_run.back() : i);
  }
}

/// \p next: number of the first sample after \p stamp_ns.
Eigen::Matrix3d GyroTurns::turnedUntil(std::int64_t stamp_ns, std::size_t next) const
{
  const std::size_t known = next == 0 ? 0 : next - 1;
  const GyroSample &sample = m_samples[known];
  const Eigen::Vector3d rate = 0.5 * (sample.rate + rateAt(m_samples, next, stamp_ns));
  return m_turned[known] * expSo3(rate * (1e-9 * double(stamp_ns - sample.stamp_ns)));
}

std::optional<Eigen::Matrix3d> GyroTurns::between(std::int64_t from_ns, std::int64_t to_ns) const
{
  if (m_samples.empty())
    return std::nullopt;
  const std::size_t begin = firstAfter(m_samples, from_ns), end = firstAfter(m_samples, to_ns);
  const bool is_covered = begin == end
                              ? to_ns - from_ns <= kMostGap_ns
                              : m_samples[begin].stamp_ns - from_ns <= kMostGap_ns && m_run[end - 1] <= begin &&
                                    to_ns - m_samples[end - 1].stamp_ns <= kMostGap_ns;
  if (!is_covered)
    return std::nullopt;
  return orthonormalized(turnedUntil(from_ns, begin).transpose() * turnedUntil(to_ns, end));
}

GyroBias refineBias(const GyroBias &bias, const GyroRotation &prior, const Eigen::Matrix3d &R,
                    const Eigen::Matrix3d &covariance)
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
  refined.covariance += kBiasWalk * kBiasWalk * prior.duration * Eigen::Matrix3d::Identity();
  return refined;
}
} // namespace bole
