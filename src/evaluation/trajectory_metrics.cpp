// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluation/trajectory_metrics.h"

#include "geometry/constants.h"

#include "geometry/names.h"
#include "geometry/so3.h"

#include <Eigen/LU>
#include <cmath>
#include <limits>

namespace bole
{
namespace
{

double rms(double sum_of_squares, std::size_t count)
{
  return count == 0 ? kNotMeasured : std::sqrt(sum_of_squares / static_cast<double>(count));
}

} // namespace

const char *toString(Alignment alignment)
{
  return nameOf(alignment, {"none", "first_pose", "xy_yaw", "xy_yaw_scale"});
}

Eigen::Matrix2d PlanarTransform::linear() const
{
  Eigen::Matrix2d R;
  R << std::cos(yaw), -std::sin(yaw), std::sin(yaw), std::cos(yaw);
  return scale * R;
}

Eigen::Vector2d PlanarTransform::operator*(const Eigen::Vector2d &xy) const { return linear() * xy + t; }

Eigen::Vector3d PlanarTransform::operator*(const Eigen::Vector3d &p) const
{
  const Eigen::Vector2d xy = *this * Eigen::Vector2d(p.head<2>());
  return {xy.x(), xy.y(), p.z() + dz};
}

Pose PlanarTransform::operator*(const Pose &wMb) const { return {expSo3({0, 0, yaw}) * wMb.R, *this * wMb.t}; }

std::vector<PosePair> pairPoses(const Trajectory &estimate, const Trajectory &truth)
{
  std::vector<PosePair> pairs;
  for (const StampedPose &pose : estimate)
    if (const auto wMb_truth = interpolate(truth, pose.stamp_ns))
      pairs.push_back({pose.stamp_ns, pose.wMb, *wMb_truth});
  return pairs;
}

std::int64_t motionShift(const Trajectory &estimate, const Trajectory &truth, std::int64_t start_ns, double range_s)
{
  const auto error = [&](std::int64_t shift_ns) {
    Trajectory shifted = estimate;
    for (StampedPose &pose : shifted)
      pose.stamp_ns += shift_ns;
    const auto pairs = pairPoses(shifted, truth);
    const RelativeErrors relative = relativeErrors(pairs, 0.3);
    if (2 * pairs.size() < estimate.size() || relative.intervals == 0)
      return std::numeric_limits<double>::infinity();
    return relative.translation + relative.rotation_deg * kDegree;
  };
  std::int64_t best_ns = start_ns;
  double least = error(start_ns);
  const auto search = [&](std::int64_t range_ns, std::int64_t step_ns) {
    const std::int64_t middle_ns = best_ns;
    for (std::int64_t shift_ns = middle_ns - range_ns; shift_ns <= middle_ns + range_ns; shift_ns += step_ns)
      if (const double value = error(shift_ns); value < least) {
        least = value;
        best_ns = shift_ns;
      }
  };
  constexpr std::int64_t kMillisecond_ns = 1'000'000;
  search(std::llround(range_s * 1e9), 20 * kMillisecond_ns);
  search(20 * kMillisecond_ns, kMillisecond_ns);
  return best_ns;
}

PlanarTransform align(const std::vector<PosePair> &pairs, Alignment alignment)
{
  PlanarTransform transform;
  if (pairs.empty() || alignment == Alignment::none)
    return transform;
  Eigen::Vector2d from = pairs.front().estimate.t.head<2>(), to = pairs.front().truth.t.head<2>();
  if (alignment == Alignment::first_pose) {
    transform.yaw = yawOf(pairs.front().truth.R) - yawOf(pairs.front().estimate.R);
    transform.dz = pairs.front().truth.t.z() - pairs.front().estimate.t.z();
    transform.t = to - transform.linear() * from;
    return transform;
  }
  from.setZero();
  to.setZero();
  for (const PosePair &pair : pairs) {
    from += pair.estimate.t.head<2>() / static_cast<double>(pairs.size());
    to += pair.truth.t.head<2>() / static_cast<double>(pairs.size());
  }
  double dot = 0, cross = 0, spread = 0;
  for (const PosePair &pair : pairs) {
    const Eigen::Vector2d a = pair.estimate.t.head<2>() - from, b = pair.truth.t.head<2>() - to;
    dot += a.dot(b);
    cross += a.x() * b.y() - a.y() * b.x();
    spread += a.squaredNorm();
  }
  transform.yaw = std::atan2(cross, dot);
  if (alignment == Alignment::xy_yaw_scale && spread > 1e-12)
    transform.scale = std::hypot(dot, cross) / spread;
  transform.t = to - transform.linear() * from;
  return transform;
}

TrajectoryErrors absoluteErrors(const std::vector<PosePair> &pairs, const PlanarTransform &transform)
{
  double sum = 0, sum_xy = 0, sum_rotation = 0;
  for (const PosePair &pair : pairs) {
    const Pose aligned = transform * pair.estimate;
    const Eigen::Vector3d error = aligned.t - pair.truth.t;
    sum += error.squaredNorm();
    sum_xy += error.head<2>().squaredNorm();
    sum_rotation += logSo3(pair.truth.R.transpose() * aligned.R).squaredNorm();
  }
  return {pairs.size(), rms(sum, pairs.size()), rms(sum_xy, pairs.size()), rms(sum_rotation, pairs.size()) / kDegree};
}

double halfNees(const Eigen::Vector2d &xy, const Eigen::Matrix2d &covariance, const Eigen::Vector2d &true_xy,
                const PlanarTransform &gauge)
{
  const Eigen::Matrix2d L = gauge.linear();
  const Eigen::Matrix2d P = L * covariance * L.transpose();
  const Eigen::Vector2d error = gauge * xy - true_xy;
  return P.determinant() > 0 ? 0.5 * error.dot(P.inverse() * error) : kNotMeasured;
}

double consistency(const std::vector<PosePair> &pairs, const std::map<std::int64_t, Eigen::Matrix2d> &covariances,
                   const PlanarTransform &gauge)
{
  double sum = 0;
  std::size_t count = 0;
  for (const PosePair &pair : pairs) {
    const auto covariance = covariances.find(pair.stamp_ns);
    if (pair.stamp_ns == pairs.front().stamp_ns || covariance == covariances.end())
      continue;
    const double nees = halfNees(pair.estimate.t.head<2>(), covariance->second, pair.truth.t.head<2>(), gauge);
    if (std::isnan(nees))
      continue;
    sum += nees;
    ++count;
  }
  return count == 0 ? kNotMeasured : sum / static_cast<double>(count);
}

RelativeErrors relativeErrors(const std::vector<PosePair> &pairs, double delta_s)
{
  const auto delta_ns = std::llround(delta_s * 1e9);
  double sum = 0, sum_rotation = 0;
  std::size_t count = 0, j = 0;
  for (const PosePair &start : pairs) {
    while (j < pairs.size() && pairs[j].stamp_ns - start.stamp_ns < delta_ns - 500'000)
      ++j;
    if (j == pairs.size())
      break;
    if (pairs[j].stamp_ns - start.stamp_ns > 2 * delta_ns)
      continue;
    const Pose moved_truth = start.truth.inverse() * pairs[j].truth;
    const Pose error = moved_truth.inverse() * (start.estimate.inverse() * pairs[j].estimate);
    sum += error.t.squaredNorm();
    sum_rotation += logSo3(error.R).squaredNorm();
    ++count;
  }
  return {count, rms(sum, count), rms(sum_rotation, count) / kDegree};
}
} // namespace bole
