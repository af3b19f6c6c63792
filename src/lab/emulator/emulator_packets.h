// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What an emulated drone says: pictures and navdata as bytes, numbered and stamped by its clocks.

#include "emulator/emulator.h"
#include "support/h264.h"

#include <bole/visp.h>
#include <optional>
#include <vector>

namespace bole
{
/// \p packet behind its header, \p header, of which number, time, place in the stream and size on display are given.
std::vector<std::uint8_t> paveFrame(const VideoPacketEncoder &encoder, const VideoPacketEncoder::Packet &packet,
                                    PaveHeader header);

/// Makes the packets of one drone. Times are of the flight [ns]. Not thread-safe.
class DronePackets
{
public:
  DronePackets(int generation, double frame_rate_hz, const ArDroneEmulator::Options &options);

  std::vector<std::uint8_t> picture(const vpImage<unsigned char> &image, std::int64_t stamp_ns);

  /// What the drone is doing, as the state bits tell.
  struct Condition
  {
    bool on_ground = false, emergency = false, command_watchdog = false;
  };
  /// \p navdata with state, sequence and time; empty when a client in demo mode need not have it.
  std::vector<std::uint8_t> status(Navdata navdata, std::int64_t stamp_ns, const Condition &condition);

  /// The client asked for navdata: all of them, or the demo's.
  void configure(bool wants_full);
  bool isConfigured() const { return m_configured; }

  /// Clocks and numbers from zero at \p boot_ns.
  void reboot(std::int64_t boot_ns);
  /// A picture made before the reboot was over is not sent.
  void forgetPicture();

private:
  std::vector<std::uint8_t> pavePicture(const vpImage<unsigned char> &image, std::int64_t stamp_ns);

  const int m_generation;
  const double m_frame_rate_hz;
  const ArDroneEmulator::Options m_options;
  std::optional<VideoPacketEncoder> m_encoder;
  bool m_force_key = true, m_configured = false, m_wants_full = false;
  std::int64_t m_boot_ns = 0, m_last_demo_ns;
  std::int64_t m_clock_ms = 100'000, m_navdata_clock_us = 50'000'000;
  std::uint32_t m_frame_number = 0, m_navdata_sequence = 0, m_stream_position = 0;
};
} // namespace bole
