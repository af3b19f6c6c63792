// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/gravity.h"

#include "geometry/constants.h"
#include "motion/gyro.h"

#include <algorithm>
#include <cmath>

namespace bole
{
std::optional<GravityInnovation> compareGravity(const Trajectory &poses, const std::vector<GyroSample> &samples)
{
  constexpr std::int64_t kVelocity_ns = 600'000'000; // that a velocity is taken over
  constexpr double kVelocitySigma = 0.1;             // of the difference of two such velocities [m/s]
  constexpr int kLeast = 40;                         // samples
  if (poses.size() < 3 || samples.empty() || poses.back().stamp_ns - poses.front().stamp_ns < 2 * kVelocity_ns)
    return std::nullopt;
  for (std::size_t i = 1; i < poses.size(); ++i)
    if (poses[i].stamp_ns - poses[i - 1].stamp_ns > kVelocity_ns)
      return std::nullopt; // nobody knows how it turned in between
  const auto isBefore = [](const StampedPose &pose, std::int64_t stamp_ns) { return pose.stamp_ns < stamp_ns; };
  const auto at = [&](std::int64_t stamp_ns) {
    return *std::lower_bound(poses.begin(), poses.end() - 1, stamp_ns - 1'000'000, isBefore);
  };
  struct Velocity
  {
    std::int64_t at_ns;
    Eigen::Vector3d mean;
  };
  const auto velocity = [](const StampedPose &a, const StampedPose &b) {
    return Velocity{(a.stamp_ns + b.stamp_ns) / 2, (b.wMb.t - a.wMb.t) / secondsOf(b.stamp_ns - a.stamp_ns)};
  };
  const Velocity begin = velocity(poses.front(), at(poses.front().stamp_ns + kVelocity_ns)),
                 end = velocity(at(poses.back().stamp_ns - kVelocity_ns), poses.back());
  GravityInnovation result;
  std::int64_t before_ns = begin.at_ns;
  const Eigen::Vector3d *first_force = nullptr;
  bool varies = false;
  int count = 0;
  auto pose = poses.begin();
  for (const GyroSample &sample : samples) {
    if (sample.stamp_ns <= begin.at_ns || sample.stamp_ns > end.at_ns)
      continue;
    if (!sample.force || secondsOf(sample.stamp_ns - before_ns) > kMostGap_s)
      return std::nullopt;
    before_ns = sample.stamp_ns;
    while (pose + 1 != poses.end() && (pose->stamp_ns + (pose + 1)->stamp_ns) / 2 < sample.stamp_ns)
      ++pose; // the one nearest in time
    first_force = first_force == nullptr ? &*sample.force : first_force;
    varies = varies || *first_force != *sample.force;
    result.off += pose->wMb.R * *sample.force;
    result.by_rotation += pose->wMb.R * skew(*sample.force);
    result.by_bias -= pose->wMb.R;
    ++count;
  }
  if (count < kLeast || !varies || secondsOf(end.at_ns - before_ns) > kMostGap_s)
    return std::nullopt;
  const double dt = secondsOf(end.at_ns - begin.at_ns);
  result.off = (result.off / count - (end.mean - begin.mean) / dt - kGravity * Eigen::Vector3d::UnitZ()).eval();
  result.by_rotation /= count;
  result.by_bias /= count;
  result.sigma = kVelocitySigma / dt;
  return result;
}
} // namespace bole
