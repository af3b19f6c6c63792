// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Sockets of who is asked, which close themselves and never wait. Failures are results, not exceptions.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <netinet/in.h>
#include <string>

namespace bole
{
class ServerSocket
{
public:
  ServerSocket() = default;
  ~ServerSocket() { close(); }
  ServerSocket(ServerSocket &&other) noexcept : m_descriptor(other.m_descriptor) { other.m_descriptor = -1; }
  ServerSocket &operator=(ServerSocket &&other) noexcept;

  /// A UDP or listening TCP socket on \p host; port 0 takes any free one. Throws vpException when the port is taken.
  static ServerSocket bindUdp(const std::string &host, std::uint16_t port);
  static ServerSocket listenTcp(const std::string &host, std::uint16_t port);

  bool valid() const { return m_descriptor >= 0; }
  std::uint16_t localPort() const;
  void close();

  /// A connection that waits to be taken; invalid where none does.
  ServerSocket accept() const;
  /// A datagram that has come, and from whom; false where none has.
  bool receiveFrom(std::uint8_t *buffer, std::size_t capacity, std::size_t &size, sockaddr_in &sender) const;
  bool sendTo(const void *data, std::size_t size, const sockaddr_in &peer) const;
  /// Sends on a stream what fits now: bytes sent, 0 when the peer must read first, -1 when it is gone.
  std::int64_t sendSome(const std::uint8_t *data, std::size_t size) const;

private:
  explicit ServerSocket(int descriptor) : m_descriptor(descriptor) {}
  static ServerSocket bindTo(const std::string &host, std::uint16_t port, int type);

  int m_descriptor = -1;
};
} // namespace bole
