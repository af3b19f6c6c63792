// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/gravity.h"

#include "geometry/constants.h"
#include "input/trajectory.h"
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
  const auto isBefore = [](const StampedPose &pose, std::int64_t stamp_ns) { return pose.stamp_ns < stamp_ns; };
  const auto at = [&](std::int64_t stamp_ns) {
    return *std::lower_bound(poses.begin(), poses.end() - 1, stamp_ns - 1'000'000, isBefore);
  };
  struct Velocity
  {
    std::int64_t at_ns;
    double duration; // [s]
    Eigen::Vector3d mean;
  };
  const auto velocity = [](const StampedPose &a, const StampedPose &b) {
    const double duration = secondsOf(b.stamp_ns - a.stamp_ns);
    return Velocity{(a.stamp_ns + b.stamp_ns) / 2, duration, (b.wMb.t - a.wMb.t) / duration};
  };
  const Velocity begin = velocity(poses.front(), at(poses.front().stamp_ns + kVelocity_ns)),
                 end = velocity(at(poses.back().stamp_ns - kVelocity_ns), poses.back());
  const std::int64_t begin_ns = poses.front().stamp_ns, end_ns = poses.back().stamp_ns;
  GravityInnovation result;
  std::int64_t before_ns = begin_ns;
  const Eigen::Vector3d *first_force = nullptr;
  bool varies = false;
  int count = 0;
  double weights = 0;
  for (const GyroSample &sample : samples) {
    if (sample.stamp_ns <= begin_ns || sample.stamp_ns > end_ns)
      continue;
    if (!sample.force || secondsOf(sample.stamp_ns - before_ns) > kMostGap_s)
      return std::nullopt;
    before_ns = sample.stamp_ns;
    const std::optional<Pose> pose = interpolate(poses, sample.stamp_ns, kVelocity_ns);
    if (!pose)
      return std::nullopt; // nobody knows how it turned in between
    // The difference of two mean velocities is that of the accelerations between, those within either mean in part.
    const double weight = std::min({secondsOf(sample.stamp_ns - begin_ns) / begin.duration,
                                    secondsOf(end_ns - sample.stamp_ns) / end.duration, 1.0});
    first_force = first_force == nullptr ? &*sample.force : first_force;
    varies = varies || *first_force != *sample.force;
    result.off += weight * pose->R * *sample.force;
    result.by_rotation += weight * pose->R * skew(*sample.force);
    result.by_bias -= weight * pose->R;
    weights += weight;
    ++count;
  }
  if (count < kLeast || !varies || secondsOf(end_ns - before_ns) > kMostGap_s)
    return std::nullopt;
  const double dt = secondsOf(end.at_ns - begin.at_ns);
  result.off = (result.off / weights - (end.mean - begin.mean) / dt - kGravity * Eigen::Vector3d::UnitZ()).eval();
  result.by_rotation /= weights;
  result.by_bias /= weights;
  result.sigma = kVelocitySigma / dt;
  return result;
}
} // namespace bole
