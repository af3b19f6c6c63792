// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where a drone is: `ardrone://HOST[?key=value&...]`.

#include <cstdint>
#include <string>

namespace bole
{
/// Its keys are told of at vpArDroneGrabber.
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
