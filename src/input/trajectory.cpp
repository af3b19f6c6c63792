// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/trajectory.h"
#include "input/csv_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
/// How far from 1 the norm of a quaternion may be: files keep as few as four decimals.
constexpr double kNormTolerance = 0.01;

/// \p order: columns of qw, qx, qy, qz.
Pose readPose(const CsvReader &csv, const std::array<std::size_t, 4> &order)
{
  const Eigen::Vector3d t(csv.number(1, "x"), csv.number(2, "y"), csv.number(3, "z"));
  const double qw = csv.number(order[0], "qw"), qx = csv.number(order[1], "qx");
  const double qy = csv.number(order[2], "qy"), qz = csv.number(order[3], "qz");
  const double norm = std::sqrt(qw * qw + qx * qx + qy * qy + qz * qz);
  if (std::abs(norm - 1) > kNormTolerance)
    csv.fail(fmt::format("norm of the quaternion = {:.4g}, must be 1", norm));
  return Pose::fromQuaternion(qw, qx, qy, qz, t);
}

Trajectory nonEmpty(Trajectory trajectory, const std::string &path)
{
  if (trajectory.empty())
    throw vpException(vpException::ioError, fmt::format("{}: no pose in it", path));
  return trajectory;
}
} // namespace

std::optional<Pose> interpolate(const Trajectory &trajectory, std::int64_t stamp_ns, std::int64_t max_gap_ns)
{
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), stamp_ns,
                                      [](const StampedPose &pose, std::int64_t t) { return pose.stamp_ns < t; });
  if (after == trajectory.end())
    return std::nullopt;
  if (after->stamp_ns == stamp_ns)
    return after->wMb;
  if (after == trajectory.begin())
    return std::nullopt;
  const auto before = after - 1;
  if (after->stamp_ns - before->stamp_ns > max_gap_ns)
    return std::nullopt;
  const double part =
      static_cast<double>(stamp_ns - before->stamp_ns) / static_cast<double>(after->stamp_ns - before->stamp_ns);
  return before->wMb.plus(part * after->wMb.minus(before->wMb));
}

Trajectory readAslTrajectory(const std::string &path)
{
  Trajectory trajectory;
  CsvReader csv(path, {8});
  while (csv.next())
    trajectory.push_back({csv.risingStampNs(0), readPose(csv, {4, 5, 6, 7})});
  return nonEmpty(std::move(trajectory), path);
}

Trajectory readTumTrajectory(const std::string &path)
{
  Trajectory trajectory;
  CsvReader csv(path, {8, ' ', {}});
  while (csv.next())
    trajectory.push_back({csv.risingStampFromSeconds(0), readPose(csv, {7, 4, 5, 6})});
  return nonEmpty(std::move(trajectory), path);
}

Trajectory readTrajectory(const std::string &path)
{
  CsvReader csv(path, {1});
  const bool has_commas = csv.next() && csv.columns() > 1;
  return has_commas ? readAslTrajectory(path) : readTumTrajectory(path);
}
} // namespace bole
