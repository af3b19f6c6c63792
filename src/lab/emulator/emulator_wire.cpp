// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/emulator_wire.h"

#include "support/text.h"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <cerrno>
#include <cstring>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>
#include <utility>

namespace bole
{
ServerSocket &ServerSocket::operator=(ServerSocket &&other) noexcept
{
  std::swap(m_descriptor, other.m_descriptor);
  return *this;
}

void ServerSocket::close()
{
  if (m_descriptor >= 0)
    ::close(m_descriptor);
  m_descriptor = -1;
}

ServerSocket ServerSocket::bindTo(std::uint16_t port, int type)
{
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  ServerSocket socket(::socket(AF_INET, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  setsockopt(socket.m_descriptor, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  if (bind(socket.m_descriptor, reinterpret_cast<const sockaddr *>(&address), sizeof(address)) != 0 ||
      (type == SOCK_STREAM && listen(socket.m_descriptor, 4) != 0))
    throw ioError("{} port {} of 127.0.0.1: {}", type == SOCK_DGRAM ? "UDP" : "TCP", port, std::strerror(errno));
  return socket;
}

std::uint16_t ServerSocket::localPort() const
{
  sockaddr_in address = {};
  socklen_t length = sizeof(address);
  getsockname(m_descriptor, reinterpret_cast<sockaddr *>(&address), &length);
  return ntohs(address.sin_port);
}

ServerSocket ServerSocket::accept() const
{
  ServerSocket socket(::accept4(m_descriptor, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  const int on = 1;
  setsockopt(socket.m_descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  return socket;
}

bool ServerSocket::receiveFrom(std::uint8_t *buffer, std::size_t capacity, std::size_t &size, sockaddr_in &sender) const
{
  socklen_t length = sizeof(sender);
  const ssize_t count = recvfrom(m_descriptor, buffer, capacity, 0, reinterpret_cast<sockaddr *>(&sender), &length);
  size = count > 0 ? static_cast<std::size_t>(count) : 0;
  return count > 0;
}

bool ServerSocket::sendTo(const void *data, std::size_t size, const sockaddr_in &peer) const
{
  return ::sendto(m_descriptor, data, size, MSG_NOSIGNAL, reinterpret_cast<const sockaddr *>(&peer), sizeof(peer)) ==
         static_cast<ssize_t>(size);
}

std::int64_t ServerSocket::sendSome(const std::uint8_t *data, std::size_t size) const
{
  const ssize_t count = ::send(m_descriptor, data, size, MSG_NOSIGNAL);
  if (count < 0)
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ? 0 : -1;
  return count;
}

namespace
{
constexpr std::size_t kMostPending = 1 << 20;
constexpr std::int64_t kClientLost_ns = 10'000'000'000;
} // namespace

DroneWire::DroneWire(int generation, std::uint16_t navdata_port, std::uint16_t video_port, std::uint16_t at_port)
    : m_generation(generation),
      m_video_port(video_port),
      m_navdata(ServerSocket::bindTo(navdata_port, SOCK_DGRAM)),
      m_at(ServerSocket::bindTo(at_port, SOCK_DGRAM))
{
  comeUp();
}

void DroneWire::comeUp()
{
  if (m_video.valid())
    return;
  m_video = ServerSocket::bindTo(m_video_port, m_generation == 2 ? SOCK_STREAM : SOCK_DGRAM);
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
