// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Sockets that close themselves. Failures are results, not exceptions: on a radio link they are daily life.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

namespace bole
{
using Milliseconds = std::chrono::milliseconds;

class Socket
{
public:
  Socket() = default;
  explicit Socket(int descriptor) : m_descriptor(descriptor) {}
  ~Socket() { close(); }
  Socket(Socket &&other) noexcept : m_descriptor(other.m_descriptor) { other.m_descriptor = -1; }
  Socket &operator=(Socket &&other) noexcept;

  /// A TCP connection, or an invalid socket when there is none within \p timeout.
  static Socket connectTcp(const std::string &host, std::uint16_t port, Milliseconds timeout);
  /// A UDP socket that talks to one peer only.
  static Socket connectUdp(const std::string &host, std::uint16_t port);

  bool valid() const { return m_descriptor >= 0; }
  void close();

  /// Waits for bytes (or a connection) at most \p timeout.
  bool waitReadable(Milliseconds timeout) const;
  enum class Read
  {
    data,
    timeout,
    closed
  };
  /// One datagram, or what there is of a stream.
  Read receive(std::uint8_t *buffer, std::size_t capacity, std::size_t &size, Milliseconds timeout) const;
  bool send(const void *data, std::size_t size) const; ///< false on any failure

private:
  int m_descriptor = -1;
};
} // namespace bole
