// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where a drone is: `ardrone://HOST[?key=value&...]`.

#include <cstdint>
#include <string>

namespace bole
{
/// Keys (all optional):
/// | key | meaning | default |
/// |---|---|---|
/// | `offset` | added to the three ports below, 0 .. 59000: several emulators on one machine | 0 |
/// | `navdata`, `video`, `at` | UDP, TCP (drone 2) or UDP (drone 1), UDP port | 5554, 5555, 5556 |
/// | `generation` | `1`, `2` or `auto`: tries the drone 2's TCP port first | `auto` |
/// | `camera` | camera file, readCamera() | the published calibration of the generation |
/// | `video_delay_ms` | from exposure to the arrival of the fastest frame, 0 .. 500 | 60 |
///
/// `ardrone://` alone is the drone's own network, 192.168.1.1.
struct ArDroneAddress
{
  std::string host = "192.168.1.1";
  std::uint16_t navdata_port = 5554, video_port = 5555, at_port = 5556;
  int generation = 0; ///< 1, 2, or 0 to find out
  std::string camera_path;
  double video_delay_s = 0.06;

  /// Throws vpException "address: key = value, must be ...".
  static ArDroneAddress parse(const std::string &address);
  /// Whether \p text is such an address, right or wrong.
  static bool accepts(const std::string &text);
  std::string toString() const;
};
} // namespace bole
