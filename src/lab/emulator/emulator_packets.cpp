// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/emulator_packets.h"

#include "emulator/wire_format.h"

#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr std::int64_t kOneSecond_ns = 1'000'000'000, kDemoEvery_ns = kOneSecond_ns / 15;
constexpr std::int64_t kWrapSoon_ms = 3000;
constexpr std::uint32_t kUsualState = 0x0f800080 | 0x10; // threads up, camera ready, altitude control
constexpr std::uint32_t kLanded = 2, kFlying = 3;

/// Size in bytes, start code included, of the NAL unit of \p type that begins at \p from; 0: none does.
std::uint8_t nalSize(const std::vector<std::uint8_t> &bytes, std::size_t from, int type)
{
  const auto startsAt = [&](std::size_t i) {
    return i + 3 < bytes.size() && bytes[i] == 0 && bytes[i + 1] == 0 &&
           (bytes[i + 2] == 1 || (bytes[i + 2] == 0 && bytes[i + 3] == 1));
  };
  const std::size_t payload = from + (from + 2 < bytes.size() && bytes[from + 2] == 1 ? 3 : 4);
  if (!startsAt(from) || payload >= bytes.size() || (bytes[payload] & 0x1f) != type)
    return 0;
  std::size_t end = payload + 1;
  while (end < bytes.size() && !startsAt(end))
    ++end;
  return static_cast<std::uint8_t>(end - from);
}

VideoPacketEncoder::Settings settingsOf(const vpImage<unsigned char> &image, double rate_hz,
                                        const ArDroneEmulator::Options &options)
{
  const auto whole = [](unsigned size) { return static_cast<int>((size + 15) / 16 * 16); }; // macroblocks
  return {whole(image.getWidth()),
          whole(image.getHeight()),
          rate_hz,
          options.bit_rate,
          false,
          options.key_interval,
          fmt::format("keyint={0}:min-keyint={0}:scenecut=0", options.key_interval)};
}
} // namespace

std::vector<std::uint8_t> paveFrame(const VideoPacketEncoder &encoder, const VideoPacketEncoder::Packet &packet,
                                    PaveHeader header)
{
  header.payload_size = header.advertised_size = static_cast<std::uint32_t>(packet.bytes.size());
  header.coded_width = static_cast<std::uint16_t>(encoder.width());
  header.coded_height = static_cast<std::uint16_t>(encoder.height());
  header.frame_type = packet.is_key ? PaveFrameType::idr : PaveFrameType::p;
  if (packet.is_key) {
    header.header1_size = nalSize(packet.bytes, 0, 7);                   // SPS
    header.header2_size = nalSize(packet.bytes, header.header1_size, 8); // PPS
  }
  std::vector<std::uint8_t> bytes = encodePaveHeader(header);
  bytes.insert(bytes.end(), packet.bytes.begin(), packet.bytes.end());
  return bytes;
}

DronePackets::DronePackets(int generation, double frame_rate_hz, const ArDroneEmulator::Options &options)
    : m_generation(generation), m_frame_rate_hz(frame_rate_hz), m_options(options), m_last_demo_ns(-kOneSecond_ns)
{
  if (options.clock_wrap) {
    m_clock_ms = kPaveTimePeriod_ms - kWrapSoon_ms;
    m_navdata_clock_us = kNavdataTimePeriod_us - kWrapSoon_ms * 1000;
  }
}

void DronePackets::configure(bool wants_full)
{
  m_configured = true;
  m_wants_full = wants_full;
}

void DronePackets::reboot(std::int64_t boot_ns)
{
  m_configured = false;
  m_boot_ns = boot_ns;
  m_clock_ms = m_navdata_clock_us = 0;
  m_navdata_sequence = 0;
  forgetPicture();
}

void DronePackets::forgetPicture()
{
  m_frame_number = m_stream_position = 0;
  m_force_key = true;
}

std::vector<std::uint8_t> DronePackets::picture(const vpImage<unsigned char> &image, std::int64_t stamp_ns)
{
  ++m_frame_number;
  return m_generation == 1 ? encodeUvlc(image, m_frame_number) : pavePicture(image, stamp_ns);
}

std::vector<std::uint8_t> DronePackets::pavePicture(const vpImage<unsigned char> &image, std::int64_t stamp_ns)
{
  if (!m_encoder)
    m_encoder.emplace(settingsOf(image, m_frame_rate_hz, m_options));
  const VideoPacketEncoder::Packet encoded = m_encoder->encode(image, m_force_key);
  m_force_key = false;
  PaveHeader header;
  header.frame_number = m_frame_number;
  header.timestamp_ms = static_cast<std::uint32_t>(m_clock_ms + (stamp_ns - m_boot_ns) / 1'000'000);
  header.stream_position = m_stream_position;
  header.display_width = static_cast<std::uint16_t>(image.getWidth());
  header.display_height = static_cast<std::uint16_t>(image.getHeight());
  m_stream_position += static_cast<std::uint32_t>(encoded.bytes.size());
  return paveFrame(*m_encoder, encoded, header);
}

std::vector<std::uint8_t> DronePackets::status(Navdata navdata, std::int64_t stamp_ns, const Condition &condition)
{
  const bool is_demo = m_configured && !m_wants_full;
  if (is_demo && stamp_ns - m_last_demo_ns < kDemoEvery_ns)
    return {};
  m_last_demo_ns = stamp_ns;
  navdata.state = kUsualState | (condition.on_ground ? 0u : 1u);
  const auto raise = [&](DroneState bit, bool on) { navdata.state |= on ? static_cast<std::uint32_t>(bit) : 0u; };
  raise(DroneState::bootstrap, !m_configured);
  raise(DroneState::demo_mode, is_demo);
  raise(DroneState::command_watchdog, condition.command_watchdog);
  raise(DroneState::emergency, condition.emergency);
  navdata.sequence = ++m_navdata_sequence;
  if (!m_configured)
    navdata.demo.reset();
  if (!m_configured || is_demo)
    navdata.physical.reset();
  else
    navdata.time = navdataTimeWord(m_navdata_clock_us + (stamp_ns - m_boot_ns) / 1000);
  if (navdata.demo)
    navdata.demo->control_state = (condition.on_ground ? kLanded : kFlying) << 16;
  return encodeNavdata(navdata);
}
} // namespace bole
