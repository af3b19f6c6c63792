// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Rotations of the body by a gyro and by points.

#include "geometry/constants.h"
#include "motion/gyro.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace bole::calibration
{
inline std::int64_t nsOf(double s) { return static_cast<std::int64_t>(std::llround(s * 1e9)); }

/// The gyro integrated once: its rotation between any two times costs two lookups.
class GyroPath
{
public:
  GyroPath(const std::vector<GyroSample> &samples, const Eigen::Vector3d &bias) : m_samples(samples), m_bias(bias)
  {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (i > 0)
        R = R * turn(i - 1, samples[i].stamp_ns - samples[i - 1].stamp_ns);
      m_turned.push_back(R);
    }
  }

  /// Nothing outside of the samples and where some are missing.
  std::optional<Eigen::Matrix3d> between(std::int64_t a_ns, std::int64_t b_ns) const
  {
    const auto a = at(a_ns), b = at(b_ns);
    if (!a || !b)
      return std::nullopt;
    for (std::size_t i = a->second; i < b->second; ++i)
      if (secondsOf(m_samples[i + 1].stamp_ns - m_samples[i].stamp_ns) > kMostGap_s)
        return std::nullopt;
    return Eigen::Matrix3d(a->first.transpose() * b->first);
  }

private:
  /// From sample \p i on for \p ns, the rate linear between the samples.
  Eigen::Matrix3d turn(std::size_t i, std::int64_t ns) const
  {
    const GyroSample &from = m_samples[i], &to = m_samples[std::min(i + 1, m_samples.size() - 1)];
    const double part = to.stamp_ns > from.stamp_ns ? double(ns) / double(to.stamp_ns - from.stamp_ns) : 0;
    return expSo3((from.rate + 0.5 * part * (to.rate - from.rate) - m_bias) * secondsOf(ns));
  }

  std::optional<std::pair<Eigen::Matrix3d, std::size_t>> at(std::int64_t stamp_ns) const
  {
    const auto after = std::upper_bound(m_samples.begin(), m_samples.end(), stamp_ns,
                                        [](std::int64_t t, const GyroSample &sample) { return t < sample.stamp_ns; });
    if (after == m_samples.begin() || secondsOf(stamp_ns - (after - 1)->stamp_ns) > kMostGap_s)
      return std::nullopt;
    const auto i = static_cast<std::size_t>(after - m_samples.begin()) - 1;
    return std::make_pair(Eigen::Matrix3d(m_turned[i] * turn(i, stamp_ns - m_samples[i].stamp_ns)), i);
  }

  std::vector<GyroSample> m_samples;
  std::vector<Eigen::Matrix3d> m_turned; ///< since the first sample, at each
  Eigen::Vector3d m_bias;
};

/// The rotation of the body over an interval, by points.
struct Turn
{
  std::int64_t a_ns = 0, b_ns = 0;
  Eigen::Matrix3d aRb = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero(); ///< without that of the gyro's noise
  double duration() const { return secondsOf(b_ns - a_ns); }
};
} // namespace bole::calibration
