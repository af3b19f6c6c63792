// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/trajectory_writer.h"
#include "input/atomic_file.h"

#include <Eigen/Geometry>

#include <cstdlib>
#include <fmt/format.h>

namespace bole
{
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
