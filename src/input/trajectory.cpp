// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/trajectory.h"
#include "geometry/failure.h"
#include "input/atomic_file.h"
#include "input/csv_reader.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>

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
    csv.fail(fmt::format("norm of the quaternion = {:.4g}, must be 1; the columns must be {}", norm,
                         order[0] == 4 ? "stamp [ns],x,y,z,qw,qx,qy,qz" : "t [s] x y z qx qy qz qw"));
  return Pose::fromQuaternion(qw, qx, qy, qz, t);
}

/// Adds a pose that a body can have had after the one before.
void append(Trajectory &trajectory, const StampedPose &pose, const CsvReader &csv)
{
  constexpr double kFarthest_m = 1e6, kFastest_m_s = 300; // of anything that flies among trees, with its filter's jumps
  if (pose.wMb.t.norm() > kFarthest_m)
    csv.fail(
        fmt::format("position = {:.3g} m from the origin, must be at most {:g} m", pose.wMb.t.norm(), kFarthest_m));
  if (!trajectory.empty()) {
    const StampedPose &before = trajectory.back();
    const double elapsed_s = static_cast<double>(pose.stamp_ns - before.stamp_ns) * 1e-9;
    const double moved_m = (pose.wMb.t - before.wMb.t).norm();
    if (moved_m > kFastest_m_s * std::max(elapsed_s, 0.02))
      csv.fail(fmt::format("speed = {:.3g} m in {:.3g} s, must be at most {:g} m/s (millimetres, or stamps in another "
                           "unit?)",
                           moved_m, elapsed_s, kFastest_m_s));
  }
  trajectory.push_back(pose);
}

/// \p unit of the stamps in the file.
Trajectory checked(Trajectory trajectory, const std::string &path, const char *unit)
{
  constexpr double kSlowest_Hz = 0.05, kFastest_Hz = 20000;
  constexpr std::size_t kFewest = 10; // poses that have a rate
  if (trajectory.empty())
    throw ioError("{}: no pose in it", path);
  if (trajectory.size() < kFewest)
    return trajectory;
  const double rate_Hz = 1e9 * static_cast<double>(trajectory.size() - 1) /
                         static_cast<double>(trajectory.back().stamp_ns - trajectory.front().stamp_ns);
  if (rate_Hz < kSlowest_Hz || rate_Hz > kFastest_Hz)
    throw badValue("{}: {:.3g} poses a second, must be {:g} to {:g}: stamps must be in {}", path, rate_Hz, kSlowest_Hz,
                   kFastest_Hz, unit);
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
  while (csv.next()) {
    if (csv.columns() != 8 && !csv.header().empty() && csv.header()[0] == "%time")
      csv.fail("the columns are those of `rostopic echo -p`, must be stamp [ns],x,y,z,qw,qx,qy,qz");
    if (csv.text(0).find('.') != std::string::npos)
      csv.fail(fmt::format("timestamp = {} looks like seconds: between commas the columns must be stamp "
                           "[ns],x,y,z,qw,qx,qy,qz, between blanks t [s] x y z qx qy qz qw",
                           csv.text(0)));
    const std::int64_t stamp_ns = csv.risingStampNs(0);
    append(trajectory, {stamp_ns, readPose(csv, {4, 5, 6, 7})}, csv);
  }
  return checked(std::move(trajectory), path, "nanoseconds");
}

Trajectory readTumTrajectory(const std::string &path)
{
  Trajectory trajectory;
  CsvReader csv(path, {8, ' ', {}});
  while (csv.next()) {
    if (csv.columns() == 12 || csv.columns() == 9)
      csv.fail(fmt::format("{}, must be t [s] x y z qx qy qz qw",
                           csv.columns() == 9 ? "9 columns look like an index in front of a pose"
                                              : "12 columns look like KITTI's poses, which have no stamps"));
    const std::int64_t stamp_ns = csv.risingStampFromSeconds(0);
    append(trajectory, {stamp_ns, readPose(csv, {7, 4, 5, 6})}, csv);
  }
  return checked(std::move(trajectory), path, "seconds");
}

Trajectory readTrajectory(const std::string &path)
{
  CsvReader csv(path, {1, ' ', {}});
  const std::string first = csv.next() ? csv.text(0) : "";
  const bool has_decimal_commas = csv.columns() >= 7 && first.back() != ','; // which the reader of blanks names
  const bool has_commas = first.find(',') != std::string::npos && !has_decimal_commas;
  return has_commas ? readAslTrajectory(path) : readTumTrajectory(path);
}

std::string secondsText(std::int64_t stamp_ns)
{
  const auto parts = std::lldiv(stamp_ns, 1'000'000'000);
  return fmt::format("{}{}.{:09d}", stamp_ns < 0 ? "-" : "", std::llabs(parts.quot), std::llabs(parts.rem));
}

const char *const kTrajectoryHead = "# t [s] tx ty tz [m] qx qy qz qw, body in world\n";

std::string trajectoryLine(const StampedPose &pose)
{
  Eigen::Quaterniond q(pose.wMb.R);
  if (q.w() < 0)
    q.coeffs() = -q.coeffs();
  const Eigen::Vector3d &t = pose.wMb.t;
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", secondsText(pose.stamp_ns), t.x(), t.y(),
                     t.z(), q.x(), q.y(), q.z(), q.w());
}

void writeTrajectory(const std::string &path, const Trajectory &trajectory)
{
  std::string text = kTrajectoryHead;
  for (const StampedPose &pose : trajectory)
    text += trajectoryLine(pose);
  writeAtomically(path, text);
}
} // namespace bole
