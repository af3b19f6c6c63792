// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Commands to the drone: lines of text, `AT*NAME=sequence,arguments\r`.

#include "ardrone/socket.h"

#include <mutex>

namespace bole
{
/// A float as the drone wants it: its 32 bits read as a signed integer, in decimals (-0.8 is -1085485875).
std::string atFloat(float value);

/// Sends commands with rising sequence numbers. Thread-safe: the drone refuses numbers that go
/// back, so a program must have one channel to a drone.
class AtChannel
{
public:
  AtChannel(const std::string &host, std::uint16_t port);

  // Housekeeping: moves nothing.
  void config(const std::string &key, const std::string &value);
  void acknowledgeConfig();
  void resetWatchdog();

  // Flight: only vpRobotArDrone calls these.
  void trimFlat();
  void reference(bool take_off, bool emergency);
  /// \param roll, pitch share of the largest tilt, in [-1, 1]: left and nose down are negative.
  /// \param gaz, yaw share of the largest climb and turn rate: up and clockwise seen from above are
  /// positive. \param progressive false hovers whatever the other arguments are.
  void move(bool progressive, float roll, float pitch, float gaz, float yaw);

private:
  void send(const std::string &name, const std::string &arguments);

  Socket m_socket;
  std::mutex m_mutex;
  std::int64_t m_sequence = 0;
};
} // namespace bole
