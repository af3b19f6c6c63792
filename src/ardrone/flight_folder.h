// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A live flight written while it is flown: as an ASL folder, and as it came off the air, raw bytes with their times in
/// a form that survives being cut anywhere.

#include "ardrone/drone_link.h"
#include <bole/open_source.h>

#include <mutex>
#include <string>

namespace bole
{
/// Writes `mav0/cam0` (images as the lens gave them, sensor.yaml with the lens), `imu0` (gyro) and `odom0` frame by
/// frame. An image is complete under its name before its row is written, and a row is one write(): a killed process
/// leaves a folder that AslSource reads. Broken frames are written as rows without an image: `missing` again.
///
/// Errors: vpException when the folder has a flight already or the disk refuses.
class FlightFolder
{
public:
  FlightFolder(const std::string &folder, const MountedCamera &camera);
  ~FlightFolder();
  FlightFolder(const FlightFolder &) = delete;
  FlightFolder &operator=(const FlightFolder &) = delete;

  void write(const LiveFrame &frame);

private:
  void append(int descriptor, const std::string &line);

  std::string m_cam0;
  int m_images_csv = -1, m_gyro_csv = -1, m_odometry_csv = -1;
  std::int64_t m_last_stamp_ns = -1, m_last_gyro_ns = -1;
  std::int64_t m_first_stamp_ns = -1;
};

/// Writes `raw.bin`: a line of text that names the form and the generation, then pieces of `u32 0x45434542 ("BECE"), u8
/// channel, 3 reserved, i64 arrival [ns], u32 size, bytes, u32 CRC-32` of all before, little-endian. Each piece is one
/// write(), so a killed process leaves whole pieces but for the last, which the reader drops. Thread-safe.
class RecordingWriter
{
public:
  /// Creates \p folder and raw.bin in it; throws vpException when it cannot, or when there is a recording already.
  explicit RecordingWriter(const std::string &folder);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter &) = delete;
  RecordingWriter &operator=(const RecordingWriter &) = delete;

  void write(LinkChannel channel, std::int64_t arrival_ns, const std::uint8_t *data, std::size_t size);
  std::size_t bytes() const;
  /// Not empty when the disk refused something: what, first time.
  std::string error() const;

private:
  mutable std::mutex m_mutex;
  int m_descriptor = -1;
  std::string m_path, m_error;
  std::size_t m_bytes = 0;
};
} // namespace bole
