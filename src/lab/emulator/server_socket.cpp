// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/emulator_wire.h"

#include "support/text.h"

#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <netdb.h>
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

ServerSocket ServerSocket::bindTo(const std::string &host, std::uint16_t port, int type)
{
  addrinfo hints = {}, *found = nullptr;
  hints.ai_family = AF_INET;
  sockaddr_in address = {};
  const bool is_known = getaddrinfo(host.c_str(), nullptr, &hints, &found) == 0 && found != nullptr;
  if (is_known) {
    std::memcpy(&address, found->ai_addr, sizeof(address));
    freeaddrinfo(found);
  }
  address.sin_port = htons(port);
  ServerSocket socket(::socket(AF_INET, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  setsockopt(socket.m_descriptor, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  if (!is_known || bind(socket.m_descriptor, reinterpret_cast<const sockaddr *>(&address), sizeof(address)) != 0 ||
      (type == SOCK_STREAM && listen(socket.m_descriptor, 4) != 0))
    throw ioError("{} port {} of {}: {}", type == SOCK_DGRAM ? "UDP" : "TCP", port, host, std::strerror(errno));
  return socket;
}

ServerSocket ServerSocket::bindUdp(const std::string &host, std::uint16_t port)
{
  return bindTo(host, port, SOCK_DGRAM);
}
ServerSocket ServerSocket::listenTcp(const std::string &host, std::uint16_t port)
{
  return bindTo(host, port, SOCK_STREAM);
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
} // namespace bole
