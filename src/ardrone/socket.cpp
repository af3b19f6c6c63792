// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/socket.h"

#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <optional>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace bole
{
namespace
{
std::optional<sockaddr_in> resolve(const std::string &host, std::uint16_t port)
{
  addrinfo hints = {}, *found = nullptr;
  hints.ai_family = AF_INET;
  if (getaddrinfo(host.c_str(), nullptr, &hints, &found) != 0 || found == nullptr)
    return std::nullopt;
  sockaddr_in address = {};
  std::memcpy(&address, found->ai_addr, sizeof(address));
  address.sin_port = htons(port);
  freeaddrinfo(found);
  return address;
}

bool waitFor(int descriptor, short events, Milliseconds timeout)
{
  pollfd waiting = {descriptor, events, 0};
  return poll(&waiting, 1, static_cast<int>(timeout.count())) > 0;
}

void setNonBlocking(int descriptor) { fcntl(descriptor, F_SETFL, fcntl(descriptor, F_GETFL, 0) | O_NONBLOCK); }
} // namespace

Socket &Socket::operator=(Socket &&other) noexcept
{
  std::swap(m_descriptor, other.m_descriptor);
  return *this;
}

void Socket::close()
{
  if (m_descriptor >= 0)
    ::close(m_descriptor);
  m_descriptor = -1;
}

Socket Socket::connectTcp(const std::string &host, std::uint16_t port, Milliseconds timeout)
{
  const auto address = resolve(host, port);
  Socket socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!address || !socket.valid())
    return {};
  setNonBlocking(socket.m_descriptor);
  if (connect(socket.m_descriptor, reinterpret_cast<const sockaddr *>(&*address), sizeof(*address)) != 0) {
    int error = 0;
    socklen_t length = sizeof(error);
    if (errno != EINPROGRESS || !waitFor(socket.m_descriptor, POLLOUT, timeout) ||
        getsockopt(socket.m_descriptor, SOL_SOCKET, SO_ERROR, &error, &length) != 0 || error != 0)
      return {};
  }
  const int on = 1;
  setsockopt(socket.m_descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  return socket;
}

Socket Socket::connectUdp(const std::string &host, std::uint16_t port)
{
  const auto address = resolve(host, port);
  Socket socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (!address || !socket.valid() ||
      connect(socket.m_descriptor, reinterpret_cast<const sockaddr *>(&*address), sizeof(*address)) != 0)
    return {};
  setNonBlocking(socket.m_descriptor);
  return socket;
}

bool Socket::waitReadable(Milliseconds timeout) const { return waitFor(m_descriptor, POLLIN, timeout); }

Socket::Read Socket::receive(std::uint8_t *buffer, std::size_t capacity, std::size_t &size, Milliseconds timeout) const
{
  size = 0;
  if (!waitReadable(timeout))
    return Read::timeout;
  const ssize_t count = recv(m_descriptor, buffer, capacity, 0);
  if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR))
    return Read::timeout;
  if (count <= 0)
    return Read::closed; // for a datagram socket: the port at the other end is closed
  size = static_cast<std::size_t>(count);
  return Read::data;
}

bool Socket::send(const void *data, std::size_t size) const
{
  return ::send(m_descriptor, data, size, MSG_NOSIGNAL) == static_cast<ssize_t>(size);
}
} // namespace bole
