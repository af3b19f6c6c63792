// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/open_source.h>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace bole::asl
{
std::string sensorYaml(const MountedCamera &camera, const std::string &comment, double rate_hz)
{
  std::string matrix;
  const Eigen::Matrix<double, 3, 4> T = (Eigen::Matrix<double, 3, 4>() << camera.bMc.R, camera.bMc.t).finished();
  for (int k = 0; k < 12; ++k)
    matrix += fmt::format("{}, ", T(k / 4, k % 4) + 0.0); // no -0
  const Distortion distortion = camera.model.distortion;
  const int count = distortion == Distortion::none ? 0 : distortion == Distortion::fov ? 1 : 4;
  const auto &c = camera.model.coefficients;
  const PinholeCamera &p = camera.model.pinhole;
  return fmt::format("sensor_type: camera\ncomment: {}\nT_BS:\n  cols: 4\n  rows: 4\n"
                     "  data: [{}0.0, 0.0, 0.0, 1.0]\nrate_hz: {}\nresolution: [{}, {}]\ncamera_model: pinhole\n"
                     "intrinsics: [{}, {}, {}, {}]\ndistortion_model: {}\ndistortion_coefficients: [{}]\n",
                     comment, matrix, rate_hz, p.width, p.height, p.fx, p.fy, p.cx, p.cy, toString(distortion),
                     fmt::join(c.begin(), c.begin() + count, ", "));
}

std::string imuLine(std::int64_t stamp_ns, const Eigen::Vector3d &w, const Eigen::Vector3d &a)
{
  return fmt::format("{},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f}\n", stamp_ns, w.x(), w.y(), w.z(), a.x(), a.y(),
                     a.z());
}

std::string poseLine(std::int64_t stamp_ns, const Pose &pose)
{
  Eigen::Quaterniond q(pose.R);
  if (q.w() < 0)
    q.coeffs() = -q.coeffs();
  return fmt::format("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n", stamp_ns, pose.t.x(), pose.t.y(),
                     pose.t.z(), q.w(), q.x(), q.y(), q.z());
}
} // namespace bole::asl
