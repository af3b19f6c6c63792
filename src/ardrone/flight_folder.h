// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A live flight as an ASL folder, written while it is flown.

#include "ardrone/drone_link.h"
#include <bole/open_source.h>

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
} // namespace bole
