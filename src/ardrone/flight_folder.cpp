// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/flight_folder.h"

#include "ardrone/bytes.h"
#include "geometry/failure.h"
#include "input/codec.h"
#include <bole/open_source.h>

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <unistd.h>

extern "C" {
#include <libavutil/crc.h>
}

namespace bole
{
namespace
{
namespace fs = std::filesystem;

int create(const fs::path &path, const std::string &head)
{
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
  if (descriptor < 0 || ::write(descriptor, head.data(), head.size()) != static_cast<ssize_t>(head.size()))
    throw ioError("{}: {}", path.string(), std::strerror(errno));
  return descriptor;
}

} // namespace

FlightFolder::FlightFolder(const std::string &folder, const MountedCamera &camera)
{
  const fs::path mav0 = fs::path(folder) / "mav0";
  std::error_code error;
  for (const char *sub : {"cam0/data", "imu0", "odom0"})
    fs::create_directories(mav0 / sub, error);
  m_cam0 = (mav0 / "cam0").string();
  ::close(create(mav0 / "cam0" / "sensor.yaml", asl::sensorYaml(camera, "AR.Drone front camera", 30)));
  m_images_csv = create(mav0 / "cam0" / "data.csv", asl::kImagesHead);
  m_gyro_csv = create(mav0 / "imu0" / "data.csv", asl::kImuHead);
  m_odometry_csv = create(mav0 / "odom0" / "data.csv", asl::kPosesHead);
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
    throw ioError("{}: {}", m_cam0, std::strerror(errno));
}

void FlightFolder::write(const LiveFrame &frame)
{
  if (m_first_stamp_ns < 0)
    m_first_stamp_ns = frame.stamp_ns;
  const std::int64_t stamp_ns = frame.stamp_ns - m_first_stamp_ns; // the flight starts at zero
  for (const GyroSample &sample : frame.gyro)
    if (const std::int64_t at_ns = sample.stamp_ns - m_first_stamp_ns; at_ns >= 0 && at_ns > m_last_gyro_ns) {
      const Eigen::Vector3d force = sample.force.value_or(Eigen::Vector3d(0, 0, 9.81)); // still: as if none were there
      append(m_gyro_csv, asl::imuLine(at_ns, sample.rate, force));
      m_last_gyro_ns = at_ns;
    }
  if (stamp_ns <= m_last_stamp_ns)
    return;
  m_last_stamp_ns = stamp_ns;
  if (frame.body)
    append(m_odometry_csv, asl::poseLine(stamp_ns, frame.body->wMb));
  const std::string name = fmt::format("{:013d}.png", stamp_ns);
  if (frame.status == FrameStatus::ok || frame.status == FrameStatus::stale) {
    vpImage<unsigned char> image;
    frame.picture.toGrey(image);
    ::close(create(fs::path(m_cam0) / "data" / name, encodePng(image))); // whole before the table names it
  }
  append(m_images_csv, fmt::format("{},{}\n", stamp_ns, name));
}

namespace
{
const std::string kTitle = "bole raw flight 1\n";
constexpr std::uint32_t kMagic = 0x45434542;

/// CRC-32 of IEEE 802.3.
std::uint32_t crc32(const std::uint8_t *data, std::size_t size)
{
  return ~av_crc(av_crc_get_table(AV_CRC_32_IEEE_LE), ~0u, data, size);
}
} // namespace

RecordingWriter::RecordingWriter(const std::string &folder)
{
  std::error_code error;
  fs::create_directories(folder, error);
  m_path = (fs::path(folder) / "raw.bin").string();
  m_descriptor = create(m_path, kTitle);
  m_bytes = kTitle.size();
}

RecordingWriter::~RecordingWriter()
{
  ::fsync(m_descriptor);
  ::close(m_descriptor);
}

void RecordingWriter::write(LinkChannel channel, std::int64_t arrival_ns, const std::uint8_t *data, std::size_t size)
{
  std::vector<std::uint8_t> piece;
  piece.reserve(20 + size + 4);
  appendLittleEndian(piece, kMagic);
  piece.push_back(static_cast<std::uint8_t>(channel));
  piece.resize(8, 0);
  appendLittleEndian(piece, arrival_ns);
  appendLittleEndian(piece, static_cast<std::uint32_t>(size));
  piece.insert(piece.end(), data, data + size);
  appendLittleEndian(piece, crc32(piece.data(), piece.size()));
  const std::lock_guard<std::mutex> lock(m_mutex);
  const ssize_t written = ::write(m_descriptor, piece.data(), piece.size());
  if (written != static_cast<ssize_t>(piece.size()) && m_error.empty())
    m_error = fmt::format("{}: {}", m_path, written < 0 ? std::strerror(errno) : "the disk is full");
  m_bytes += written > 0 ? static_cast<std::size_t>(written) : 0;
}

std::size_t RecordingWriter::bytes() const
{
  const std::lock_guard<std::mutex> lock(m_mutex);
  return m_bytes;
}

std::string RecordingWriter::error() const
{
  const std::lock_guard<std::mutex> lock(m_mutex);
  return m_error;
}
} // namespace bole
