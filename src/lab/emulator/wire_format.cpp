// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/wire_format.h"

#include <charconv>
#include <cstring>
#include <numeric>
#include <type_traits>

namespace bole
{
namespace
{
constexpr std::uint32_t kHeader = 0x55667788;
constexpr std::uint16_t kOptionHead = 4, kDemo = 0, kTime = 1, kPhysical = 3, kChecksum = 0xFFFF;
constexpr std::size_t kDemoSize = 144, kPhysicalSize = 42;

/// Appends \p value with its least significant byte first.
template <typename Integer> void append(std::vector<std::uint8_t> &out, Integer value)
{
  static_assert(std::is_integral_v<Integer>);
  for (std::size_t i = 0; i < sizeof value; ++i)
    out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void append(std::vector<std::uint8_t> &out, float value)
{
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  append(out, bits);
}

void append(std::vector<std::uint8_t> &out, const Eigen::Vector3f &v)
{
  for (int i = 0; i < 3; ++i)
    append(out, v[i]);
}

std::vector<std::uint8_t> encodeDemo(const Navdata::Demo &demo)
{
  std::vector<std::uint8_t> out;
  append(out, demo.control_state);
  append(out, demo.battery_percent);
  append(out, demo.phi_theta_psi_mdeg.y());
  append(out, demo.phi_theta_psi_mdeg.x());
  append(out, demo.phi_theta_psi_mdeg.z());
  append(out, demo.altitude_mm);
  append(out, demo.velocity_mm_s);
  out.resize(kDemoSize, 0);
  return out;
}

std::vector<std::uint8_t> encodePhysical(const Navdata::Physical &physical)
{
  std::vector<std::uint8_t> out(6, 0); // temperatures
  append(out, physical.acceleration_mg);
  append(out, physical.rate_deg_s);
  out.resize(kPhysicalSize, 0);
  return out;
}

/// Cuts at commas outside quotes and drops the quotes.
std::vector<std::string> splitArguments(const std::string &text)
{
  std::vector<std::string> out(1);
  bool quoted = false;
  for (const char c : text)
    if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      out.emplace_back();
    else
      out.back() += c;
  return out;
}
} // namespace

std::vector<std::uint8_t> encodeNavdata(const Navdata &navdata)
{
  std::vector<std::uint8_t> out;
  append(out, kHeader);
  append(out, navdata.state);
  append(out, navdata.sequence);
  append(out, std::uint32_t{navdata.vision_defined});
  auto options = navdata.options;
  if (navdata.demo)
    options[kDemo] = encodeDemo(*navdata.demo);
  if (navdata.time) {
    options[kTime].clear();
    append(options[kTime], *navdata.time);
  }
  if (navdata.physical)
    options[kPhysical] = encodePhysical(*navdata.physical);
  for (const auto &[id, bytes] : options) {
    append(out, id);
    append(out, static_cast<std::uint16_t>(kOptionHead + bytes.size()));
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
  const std::uint32_t sum = std::accumulate(out.begin(), out.end(), std::uint32_t{0});
  append(out, kChecksum);
  append(out, static_cast<std::uint16_t>(kOptionHead + 4));
  append(out, sum);
  return out;
}

std::uint32_t navdataTimeWord(std::int64_t microseconds)
{
  std::int64_t reduced = microseconds % kNavdataTimePeriod_us;
  if (reduced < 0)
    reduced += kNavdataTimePeriod_us;
  return static_cast<std::uint32_t>(reduced / 1'000'000) << 21 | static_cast<std::uint32_t>(reduced % 1'000'000);
}

std::vector<std::uint8_t> encodePaveHeader(const PaveHeader &header)
{
  std::vector<std::uint8_t> out = {'P', 'a', 'V', 'E'};
  out.push_back(header.version);
  out.push_back(header.codec);
  append(out, header.header_size);
  append(out, header.payload_size);
  append(out, header.coded_width);
  append(out, header.coded_height);
  append(out, header.display_width);
  append(out, header.display_height);
  append(out, header.frame_number);
  append(out, header.timestamp_ms);
  out.push_back(1); // chunks of this frame
  out.push_back(0); // index of this chunk
  out.push_back(static_cast<std::uint8_t>(header.frame_type));
  out.push_back(0); // control
  append(out, header.stream_position);
  append(out, std::uint32_t{0});
  append(out, header.stream_id);
  out.push_back(1); // slices of this frame
  out.push_back(0); // index of this slice
  out.push_back(header.header1_size);
  out.push_back(header.header2_size);
  append(out, std::uint16_t{0});
  append(out, header.advertised_size);
  out.resize(header.header_size, 0);
  return out;
}

std::vector<AtCommand> parseAtCommands(const std::string &datagram)
{
  std::vector<AtCommand> commands;
  for (std::size_t at = 0; (at = datagram.find("AT*", at)) != std::string::npos;) {
    at += 3;
    const std::size_t end = datagram.find_first_of("\r\n", at);
    const std::string line = datagram.substr(at, end == std::string::npos ? end : end - at);
    const std::size_t equals = line.find('=');
    if (equals == std::string::npos)
      continue;
    AtCommand command;
    command.name = line.substr(0, equals);
    command.arguments = splitArguments(line.substr(equals + 1));
    const std::string &number = command.arguments.front();
    const auto [behind, fault] = std::from_chars(number.data(), number.data() + number.size(), command.sequence);
    if (fault != std::errc() || behind != number.data() + number.size())
      continue;
    command.arguments.erase(command.arguments.begin());
    commands.push_back(std::move(command));
  }
  return commands;
}
} // namespace bole
