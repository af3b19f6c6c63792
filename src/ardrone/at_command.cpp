// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/at_command.h"

#include <cstring>
#include <fmt/format.h>

namespace bole
{
namespace
{
// Bits 18, 20, 22, 24 and 28 are always set in AT*REF.
constexpr std::uint32_t kReferenceBase = 0x11540000, kTakeOff = 1u << 9, kEmergency = 1u << 8;
} // namespace

std::string atFloat(float value)
{
  std::int32_t bits = 0;
  std::memcpy(&bits, &value, 4);
  return std::to_string(bits);
}

AtChannel::AtChannel(const std::string &host, std::uint16_t port) : m_socket(Socket::connectUdp(host, port)) {}

void AtChannel::send(const std::string &name, const std::string &arguments)
{
  const std::lock_guard<std::mutex> lock(m_mutex);
  std::string line = fmt::format("AT*{}={}", name, ++m_sequence);
  if (!arguments.empty())
    line += "," + arguments;
  line += "\r";
  m_socket.send(line.data(), line.size());
}

void AtChannel::config(const std::string &key, const std::string &value)
{
  send("CONFIG", fmt::format("\"{}\",\"{}\"", key, value));
}
void AtChannel::acknowledgeConfig() { send("CTRL", "5,0"); }
void AtChannel::resetWatchdog() { send("COMWDG", ""); }
void AtChannel::trimFlat() { send("FTRIM", ""); }

void AtChannel::reference(bool take_off, bool emergency)
{
  send("REF", std::to_string(kReferenceBase | (take_off ? kTakeOff : 0) | (emergency ? kEmergency : 0)));
}

void AtChannel::move(bool progressive, float roll, float pitch, float gaz, float yaw)
{
  send("PCMD",
       fmt::format("{},{},{},{},{}", progressive ? 1 : 0, atFloat(roll), atFloat(pitch), atFloat(gaz), atFloat(yaw)));
}
} // namespace bole
