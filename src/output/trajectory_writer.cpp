// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/trajectory_writer.h"
#include "output/atomic_file.h"

#include <Eigen/Geometry>

#include <cstdlib>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
std::string secondsText(std::int64_t stamp_ns)
{
  const auto parts = std::lldiv(stamp_ns, 1'000'000'000);
  return fmt::format("{}{}.{:09d}", stamp_ns < 0 ? "-" : "", std::llabs(parts.quot), std::llabs(parts.rem));
}

void writeTrajectory(const std::string &path, const Trajectory &trajectory)
{
  std::string text = "# t [s] tx ty tz [m] qx qy qz qw, body in world\n";
  for (const StampedPose &pose : trajectory) {
    Eigen::Quaterniond q(pose.wMb.R);
    if (q.w() < 0)
      q.coeffs() = -q.coeffs();
    const Eigen::Vector3d &t = pose.wMb.t;
    fmt::format_to(std::back_inserter(text), "{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                   secondsText(pose.stamp_ns), t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  writeAtomically(path, text);
}
} // namespace bole
