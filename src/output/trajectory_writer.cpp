// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/trajectory_writer.h"
#include "output/atomic_file.h"

#include <Eigen/Geometry>

#include <cstdlib>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
void writeTrajectory(const std::string &path, const Trajectory &trajectory)
{
  std::string text = "# t [s] tx ty tz [m] qx qy qz qw, body in world\n";
  for (const StampedPose &pose : trajectory) {
    Eigen::Quaterniond q(pose.wMb.R);
    if (q.w() < 0)
      q.coeffs() = -q.coeffs();
    const Eigen::Vector3d &t = pose.wMb.t;
    const auto stamp = std::lldiv(pose.stamp_ns, 1'000'000'000);
    const char *sign = pose.stamp_ns < 0 ? "-" : "";
    fmt::format_to(std::back_inserter(text), "{}{}.{:09d} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", sign,
                   std::llabs(stamp.quot), std::llabs(stamp.rem), t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  writeAtomically(path, text);
}
} // namespace bole
