// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/emulator_wire.h"

#include <algorithm>
#include <array>

namespace bole
{
namespace
{
constexpr std::size_t kMostPending = 1 << 20;
constexpr std::int64_t kClientLost_ns = 10'000'000'000;
} // namespace

DroneWire::DroneWire(const std::string &host, int generation, std::uint16_t navdata_port, std::uint16_t video_port,
                     std::uint16_t at_port)
    : m_host(host),
      m_generation(generation),
      m_video_port(video_port),
      m_navdata(ServerSocket::bindUdp(host, navdata_port)),
      m_at(ServerSocket::bindUdp(host, at_port))
{
  comeUp();
}

void DroneWire::comeUp()
{
  if (m_video.valid())
    return;
  m_video =
      m_generation == 2 ? ServerSocket::listenTcp(m_host, m_video_port) : ServerSocket::bindUdp(m_host, m_video_port);
  if (m_video_port == 0) // chosen once: other threads ask for it, and it stays over a reboot
    m_video_port = m_video.localPort();
}

void DroneWire::goDown()
{
  m_video_client.close();
  m_video.close();
  m_video_peer.reset();
  m_navdata_client.reset();
  m_pending.clear();
  m_queue.clear();
}

DroneWire::Received DroneWire::receive(std::int64_t now_ns, bool is_down)
{
  Received received;
  std::array<std::uint8_t, 2048> buffer{};
  std::size_t size = 0;
  sockaddr_in sender = {};
  const auto came = [&](const ServerSocket &socket) {
    return socket.receiveFrom(buffer.data(), buffer.size(), size, sender);
  };
  while (came(m_navdata)) {
    if (is_down)
      continue;
    m_navdata_client = sender;
    m_navdata_seen_ns = now_ns;
    received.navdata_asked = true;
  }
  while (came(m_at)) {
    if (is_down)
      continue;
    m_navdata_seen_ns = now_ns;
    received.commands.emplace_back(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
  }
  if (m_navdata_client && now_ns - m_navdata_seen_ns > kClientLost_ns)
    m_navdata_client.reset();
  if (m_video.valid())
    acceptVideo(now_ns);
  return received;
}

void DroneWire::acceptVideo(std::int64_t now_ns)
{
  if (m_generation == 2) {
    if (ServerSocket client = m_video.accept(); client.valid()) {
      m_video_client = std::move(client);
      m_pending.clear();
      m_video_since_ns = now_ns;
    }
    return;
  }
  std::array<std::uint8_t, 64> buffer{};
  std::size_t size = 0;
  sockaddr_in sender = {};
  while (m_video.receiveFrom(buffer.data(), buffer.size(), size, sender)) {
    if (!m_video_peer)
      m_video_since_ns = now_ns;
    m_video_peer = sender;
    m_video_seen_ns = now_ns;
  }
  if (m_video_peer && now_ns - m_video_seen_ns > kClientLost_ns)
    m_video_peer.reset();
}

void DroneWire::post(Port port, std::vector<std::uint8_t> bytes, std::int64_t due_ns)
{
  if (port == Port::video && m_generation == 2) // a stream keeps its order
    due_ns = m_last_video_due_ns = std::max(due_ns, m_last_video_due_ns);
  m_queue.emplace(due_ns, Outgoing{port, std::move(bytes)});
}

std::size_t DroneWire::sendDue(std::int64_t now_ns)
{
  std::size_t refused = 0;
  flush();
  while (!m_queue.empty() && m_queue.begin()->first <= now_ns) {
    Outgoing out = std::move(m_queue.begin()->second);
    m_queue.erase(m_queue.begin());
    refused += send(std::move(out)) ? 0 : 1;
  }
  return refused;
}

/// False when the TCP client has too much to read already.
bool DroneWire::send(Outgoing &&out)
{
  if (out.port == Port::navdata) {
    if (m_navdata_client)
      m_navdata.sendTo(out.bytes.data(), out.bytes.size(), *m_navdata_client);
  }
  else if (m_generation == 1) {
    if (m_video_peer && m_video.valid())
      m_video.sendTo(out.bytes.data(), out.bytes.size(), *m_video_peer);
  }
  else if (m_video_client.valid()) {
    if (m_pending.size() + out.bytes.size() > kMostPending)
      return false;
    m_pending.insert(m_pending.end(), out.bytes.begin(), out.bytes.end());
    flush();
  }
  return true;
}

void DroneWire::flush()
{
  if (m_pending.empty())
    return;
  const std::int64_t sent = m_video_client.valid() ? m_video_client.sendSome(m_pending.data(), m_pending.size()) : -1;
  if (sent < 0) {
    m_video_client.close();
    m_pending.clear();
    return;
  }
  m_pending.erase(m_pending.begin(), m_pending.begin() + static_cast<std::ptrdiff_t>(sent));
}
} // namespace bole
