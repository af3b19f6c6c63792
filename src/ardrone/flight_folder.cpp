// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/flight_folder.h"

#include <Eigen/Geometry>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <unistd.h>
#include <visp3/core/vpException.h>
#include <visp3/io/vpImageIo.h>

namespace bole
{
namespace
{
namespace fs = std::filesystem;

int create(const fs::path &path, const std::string &head)
{
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
  if (descriptor < 0 || ::write(descriptor, head.data(), head.size()) != static_cast<ssize_t>(head.size()))
    throw vpException(vpException::ioError, fmt::format("{}: {}", path.string(), std::strerror(errno)));
  return descriptor;
}

std::string sensorYaml(const MountedCamera &camera)
{
  const PinholeCamera &pinhole = camera.model.pinhole;
  const char *model = camera.model.distortion == Distortion::fov                 ? "fov"
                      : camera.model.distortion == Distortion::radial_tangential ? "radial-tangential"
                      : camera.model.distortion == Distortion::equidistant       ? "equidistant"
                                                                                 : "none";
  std::string coefficients;
  const std::size_t count = camera.model.distortion == Distortion::none  ? 0
                            : camera.model.distortion == Distortion::fov ? 1
                                                                         : 4;
  for (std::size_t i = 0; i < count; ++i)
    coefficients += fmt::format("{}{}", i > 0 ? ", " : "", camera.model.coefficients[i]);
  const Eigen::Matrix3d &R = camera.bMc.R;
  const Eigen::Vector3d &t = camera.bMc.t;
  return fmt::format("sensor_type: camera\ncomment: AR.Drone front camera\nT_BS:\n  cols: 4\n  rows: 4\n"
                     "  data: [{}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, 0, 0, 0, 1]\nrate_hz: "
                     "30\nresolution: [{}, {}]\n"
                     "camera_model: pinhole\nintrinsics: [{}, {}, {}, {}]\ndistortion_model: "
                     "{}\ndistortion_coefficients: [{}]\n",
                     R(0, 0), R(0, 1), R(0, 2), t.x(), R(1, 0), R(1, 1), R(1, 2), t.y(), R(2, 0), R(2, 1), R(2, 2),
                     t.z(), pinhole.width, pinhole.height, pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy, model,
                     coefficients);
}
} // namespace

FlightFolder::FlightFolder(const std::string &folder, const MountedCamera &camera)
{
  const fs::path mav0 = fs::path(folder) / "mav0";
  std::error_code error;
  for (const char *sub : {"cam0/data", "imu0", "odom0"})
    fs::create_directories(mav0 / sub, error);
  m_cam0 = (mav0 / "cam0").string();
  ::close(create(mav0 / "cam0" / "sensor.yaml", sensorYaml(camera)));
  m_images_csv = create(mav0 / "cam0" / "data.csv", "#timestamp [ns],filename\n");
  m_gyro_csv =
      create(mav0 / "imu0" / "data.csv", "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
                                         "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n");
  m_odometry_csv = create(mav0 / "odom0" / "data.csv", "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z "
                                                       "[m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n");
}

FlightFolder::~FlightFolder()
{
  for (const int descriptor : {m_images_csv, m_gyro_csv, m_odometry_csv}) {
    ::fsync(descriptor);
    ::close(descriptor);
  }
}

void FlightFolder::append(int descriptor, const std::string &line)
{
  if (::write(descriptor, line.data(), line.size()) != static_cast<ssize_t>(line.size()))
    throw vpException(vpException::ioError, fmt::format("{}: {}", m_cam0, std::strerror(errno)));
}

void FlightFolder::write(const LiveFrame &frame)
{
  if (m_first_stamp_ns < 0)
    m_first_stamp_ns = frame.stamp_ns;
  const std::int64_t stamp_ns = frame.stamp_ns - m_first_stamp_ns; // the flight starts at zero
  for (const GyroSample &sample : frame.gyro)
    if (const std::int64_t at_ns = sample.stamp_ns - m_first_stamp_ns; at_ns >= 0 && at_ns > m_last_gyro_ns) {
      const Eigen::Vector3d force = sample.force.value_or(Eigen::Vector3d(0, 0, 9.81)); // still: as if none were there
      append(m_gyro_csv, fmt::format("{},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f}\n", at_ns, sample.rate.x(),
                                     sample.rate.y(), sample.rate.z(), force.x(), force.y(), force.z()));
      m_last_gyro_ns = at_ns;
    }
  if (stamp_ns <= m_last_stamp_ns)
    return;
  m_last_stamp_ns = stamp_ns;
  if (frame.body) {
    const Eigen::Quaterniond q(frame.body->wMb.R);
    const Eigen::Vector3d &t = frame.body->wMb.t;
    append(m_odometry_csv, fmt::format("{},{:.6f},{:.6f},{:.6f},{:.9f},{:.9f},{:.9f},{:.9f}\n", stamp_ns, t.x(), t.y(),
                                       t.z(), q.w(), q.x(), q.y(), q.z()));
  }
  const std::string name = fmt::format("{:013d}.png", stamp_ns);
  if (frame.status == FrameStatus::ok || frame.status == FrameStatus::stale) {
    vpImage<unsigned char> image;
    frame.picture.toGrey(image);
    const std::string part = m_cam0 + "/part.png";
    vpImageIo::write(image, part);
    fs::rename(part, fs::path(m_cam0) / "data" / name);
    ++m_images;
  }
  append(m_images_csv, fmt::format("{},{}\n", stamp_ns, name));
}
} // namespace bole
