// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The sockets of an emulated drone and who listens on them.
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <netinet/in.h>
#include <optional>
#include <string>
#include <vector>

namespace bole
{
/// Sockets of who is asked, which close themselves and never wait. Failures are results, not exceptions.
class ServerSocket
{
public:
  ServerSocket() = default;
  ~ServerSocket() { close(); }
  ServerSocket(ServerSocket &&other) noexcept : m_descriptor(other.m_descriptor) { other.m_descriptor = -1; }
  ServerSocket &operator=(ServerSocket &&other) noexcept;

  /// On the loopback address, by UDP (SOCK_DGRAM), or TCP that listens (SOCK_STREAM); port 0 takes any free one. Throws
  /// vpException when the port is taken.
  static ServerSocket bindTo(std::uint16_t port, int type);

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
  int m_descriptor = -1;
};

/// Serves one listener a port: video by TCP (generation 2) or UDP (1), navdata and commands by UDP.
/// What is sent leaves at the time it is due. Not thread-safe.
class DroneWire
{
public:
  enum class Port
  {
    video,
    navdata
  };
  /// Port 0 takes any free one. Throws vpException when a port is taken.
  DroneWire(int generation, std::uint16_t navdata_port, std::uint16_t video_port, std::uint16_t at_port);

  struct Received
  {
    bool navdata_asked = false;        ///< somebody wrote to the navdata port
    std::vector<std::string> commands; ///< datagrams of the command port
  };
  /// What came since the last call; \p is_down: a drone that reboots hears nothing.
  Received receive(std::int64_t now_ns, bool is_down);

  void post(Port port, std::vector<std::uint8_t> bytes, std::int64_t due_ns);
  /// \return video packets that were dropped since the listener did not read.
  std::size_t sendDue(std::int64_t now_ns);
  bool isIdle() const { return m_queue.empty() && m_pending.empty(); }

  bool hasVideoListener() const { return m_video_client.valid() || m_video_peer.has_value(); }
  bool hasNavdataListener() const { return m_navdata_client.has_value(); }
  std::int64_t videoSinceNs() const { return m_video_since_ns; }
  void closeVideoClient() { m_video_client.close(); }
  /// A reboot: every listener is lost until comeUp().
  void goDown();
  void comeUp();

  std::uint16_t navdataPort() const { return m_navdata.localPort(); }
  std::uint16_t videoPort() const { return m_video_port; }
  std::uint16_t atPort() const { return m_at.localPort(); }

private:
  struct Outgoing
  {
    Port port;
    std::vector<std::uint8_t> bytes;
  };
  void acceptVideo(std::int64_t now_ns);
  bool send(Outgoing &&out);
  void flush();

  int m_generation;
  std::uint16_t m_video_port;
  ServerSocket m_navdata, m_at, m_video, m_video_client;
  std::optional<sockaddr_in> m_navdata_client, m_video_peer;
  std::int64_t m_navdata_seen_ns = 0, m_video_seen_ns = 0, m_video_since_ns = 0;
  std::int64_t m_last_video_due_ns = 0;
  std::vector<std::uint8_t> m_pending; // of the TCP client
  std::multimap<std::int64_t, Outgoing> m_queue;
};
} // namespace bole
