// SPDX-License-Identifier: GPL-2.0-or-later
// Whoever speaks on the drone's ports: the client neither believes it, nor fills its memory, nor ever answers with a
// flight command. On loopback; every loop is bounded, nothing measures time.
#include "files.h"
#include "flight.h"
#include "support/test.h"

#include "ardrone/video_decoder.h"
#include "emulator/emulator_packets.h"
#include "emulator/emulator_wire.h"
#include "emulator/wire_format.h"
#include <netinet/in.h>

using namespace bole;
using test::eventually;

namespace
{
using Bytes = std::vector<std::uint8_t>;

/// Bare sockets in the place of a drone. They send what a test wants, and read what the client says.
class FakeDrone
{
public:
  explicit FakeDrone(int generation) : m_generation(generation)
  {
    if (generation == 2)
      listener = ServerSocket::bindTo(0, SOCK_STREAM);
    else
      video = ServerSocket::bindTo(0, SOCK_DGRAM);
  }

  ArDroneAddress address() const
  {
    ArDroneAddress address;
    address.host = "127.0.0.1";
    address.navdata_port = navdata.localPort();
    address.video_port = m_generation == 2 ? listener.localPort() : video.localPort();
    address.at_port = m_at.localPort();
    address.generation = m_generation;
    return address;
  }

  /// The client's end of \p socket, from the first datagram that it sends.
  static sockaddr_in clientOf(const ServerSocket &socket)
  {
    sockaddr_in client = {};
    EXPECT_TRUE(eventually([&] {
      Bytes buffer(2048);
      std::size_t size = 0;
      return socket.receiveFrom(buffer.data(), buffer.size(), size, client);
    }));
    return client;
  }

  /// The client's next connection to the video port.
  ServerSocket accept() const
  {
    ServerSocket client;
    EXPECT_TRUE(eventually([&] {
      client = listener.accept();
      return client.valid();
    }));
    return client;
  }

  /// Names of all commands that came so far.
  const std::set<std::string> &commands()
  {
    Bytes buffer(1 << 16);
    std::size_t size = 0;
    sockaddr_in sender = {};
    while (m_at.receiveFrom(buffer.data(), buffer.size(), size, sender))
      for (const AtCommand &command : parseAtCommands(std::string(buffer.begin(), buffer.begin() + size)))
        m_commands.insert(command.name);
    return m_commands;
  }
  void expectNoFlightCommand()
  {
    EXPECT_TRUE(eventually([&] { return commands().count("COMWDG") > 0; })); // the port is the right one
    for (const std::string &name : commands())
      EXPECT_TRUE(name == "CONFIG" || name == "CTRL" || name == "COMWDG") << name;
  }

  ServerSocket navdata = ServerSocket::bindTo(0, SOCK_DGRAM), listener, video;

private:
  int m_generation;
  ServerSocket m_at = ServerSocket::bindTo(0, SOCK_DGRAM);
  std::set<std::string> m_commands;
};

Navdata packet(std::uint32_t sequence)
{
  Navdata navdata;
  navdata.sequence = sequence;
  navdata.time = navdataTimeWord(5000 * std::int64_t{sequence});
  navdata.demo = Navdata::Demo{};
  navdata.demo->velocity_mm_s = {1000, 0, 0};
  navdata.demo->altitude_mm = 1500;
  navdata.physical = Navdata::Physical{};
  return navdata;
}

void send(const ServerSocket &socket, const Bytes &bytes, const sockaddr_in &to)
{
  socket.sendTo(bytes.data(), bytes.size(), to);
}

/// A key frame with its header, of a stream of its own.
Bytes paveFrame(std::uint32_t number)
{
  VideoPacketEncoder encoder({160, 128, 20, 1e6, false, 1, ""});
  const auto encoded = encoder.encode(test::stripes(160, 120, static_cast<int>(number)), true);
  PaveHeader header;
  header.display_width = 160;
  header.display_height = 120;
  header.frame_number = number;
  header.timestamp_ms = 50 * number;
  return paveFrame(encoder, encoded, header);
}

/// All of \p bytes, as long as the client stays; false when it goes.
bool sendAll(const ServerSocket &socket, const Bytes &bytes)
{
  std::size_t sent = 0;
  return eventually([&] {
           const std::int64_t count = socket.sendSome(bytes.data() + sent, bytes.size() - sent);
           sent += count > 0 ? static_cast<std::size_t>(count) : 0;
           return count < 0 || sent == bytes.size();
         }) &&
         sent == bytes.size();
}

/// Sends good key frames until one of them arrives as a picture.
void expectSeesAgain(DroneLink &link, const std::function<void(std::uint32_t number)> &send_frame)
{
  LiveFrame frame;
  std::uint32_t number = 1000;
  EXPECT_TRUE(eventually([&] {
    send_frame(number++);
    return link.next(frame, 0.05) && frame.status == FrameStatus::ok;
  }));
}
} // namespace

TEST(Hostile, NavdataThatNoDroneCanMeasureMoveNothing)
{
  FakeDrone drone(2);
  DroneLink link(drone.address());
  const sockaddr_in client = FakeDrone::clientOf(drone.navdata);
  std::uint32_t sequence = 1;
  const float wild[] = {1e30f, -1e30f, std::numeric_limits<float>::infinity(), std::nanf("")};
  for (const float value : wild)
    for (int field = 0; field < 4; ++field) {
      Navdata navdata = packet(sequence++);
      (field == 0   ? navdata.demo->velocity_mm_s
       : field == 1 ? navdata.demo->phi_theta_psi_mdeg
       : field == 2 ? navdata.physical->rate_deg_s
                    : navdata.physical->acceleration_mg)
          .x() = value;
      send(drone.navdata, encodeNavdata(navdata), client);
    }
  ASSERT_TRUE(eventually([&] {
    send(drone.navdata, encodeNavdata(packet(sequence++)), client);
    return link.counters().navdata_packets >= 20 && link.body();
  }));
  const auto body = link.body();
  ASSERT_TRUE(body);
  EXPECT_TRUE(body->wMb.isFinite());
  EXPECT_LT(body->wMb.t.norm(), 0.1 * sequence); // at 1 m/s and 5 ms a packet it is far less
  EXPECT_LT(body->velocity.norm(), 1.1);
  drone.expectNoFlightCommand();
}

TEST(Hostile, AFloodOfNavdataDoesNotFillTheMemory)
{
  NavdataOdometry odometry;
  for (std::int64_t k = 0; k < 20000; ++k) // stamps a microsecond apart
    odometry.add(1000 * k, packet(static_cast<std::uint32_t>(k)));
  EXPECT_FALSE(odometry.at(0)); // forgotten though it is but 20 ms old
  EXPECT_TRUE(odometry.at(1000 * 19999));
}

TEST(Hostile, WhatComesFromAnotherPortIsNotHeard)
{
  FakeDrone drone(1);
  DroneLink link(drone.address());
  const sockaddr_in of_navdata = FakeDrone::clientOf(drone.navdata), of_video = FakeDrone::clientOf(drone.video);
  const ServerSocket other = ServerSocket::bindTo(0, SOCK_DGRAM);
  for (std::uint32_t k = 1; k <= 50; ++k) {
    send(other, encodeNavdata(packet(1000 + k)), of_navdata);
    send(other, encodeUvlc(test::stripes(160, 120, static_cast<int>(k)), k), of_video);
  }
  ASSERT_TRUE(eventually([&] { // the drone's own come later
    static std::uint32_t sequence = 1;
    send(drone.navdata, encodeNavdata(packet(sequence++)), of_navdata);
    return link.counters().navdata_packets > 0;
  }));
  expectSeesAgain(link, [&](std::uint32_t number) {
    send(drone.video, encodeUvlc(test::stripes(160, 120, static_cast<int>(number)), number), of_video);
  });
  const LinkCounters counters = link.counters();
  EXPECT_EQ(counters.navdata_late + counters.navdata_refused, 0u);
  EXPECT_EQ(counters.video.frames, counters.video.ok);
  drone.expectNoFlightCommand();
}

TEST(Hostile, AFloodOfTinyDatagramsMakesNoFrames)
{
  FakeDrone drone(1);
  DroneLink link(drone.address());
  const sockaddr_in client = FakeDrone::clientOf(drone.video);
  std::mt19937 random(1);
  for (int k = 0; k < 20000; ++k)
    send(drone.video, Bytes(random() % 40, static_cast<std::uint8_t>(random())), client);
  EXPECT_TRUE(eventually([&] { // and they are counted; the socket's buffer drops most
    send(drone.video, Bytes(5), client);
    return link.counters().video.refused > 100;
  }));
  LiveFrame frame;
  EXPECT_FALSE(link.next(frame, 0));
  EXPECT_EQ(link.counters().video.frames, 0u);
  expectSeesAgain(link, [&](std::uint32_t number) {
    send(drone.video, encodeUvlc(test::stripes(160, 120, static_cast<int>(number)), number), client);
  });
  drone.expectNoFlightCommand();
}

TEST(Hostile, AStreamOfLyingHeadersIsGotThrough)
{
  FakeDrone drone(2);
  DroneLink link(drone.address());
  const Bytes good = paveFrame(1);
  const auto lying = [&good](std::size_t at, std::initializer_list<std::uint8_t> bytes) {
    Bytes frame(good.begin(), good.begin() + 64);
    std::copy(bytes.begin(), bytes.end(), frame.begin() + static_cast<std::ptrdiff_t>(at));
    return frame;
  };
  Bytes nested;
  for (int k = 0; k < 500; ++k)
    nested.insert(nested.end(), good.begin(), good.begin() + 64);
  const std::vector<Bytes> streams = {
      lying(8, {0xFF, 0xFF, 0xFF, 0xFF}),  // a payload of 4 GB
      lying(8, {0xFF, 0xFF, 0xFF, 0x7F}),  // of 2 GB
      lying(8, {0x00, 0x00, 0x00, 0x80}),  // a negative one
      lying(12, {0xFF, 0xFF, 0xFF, 0xFF}), // a picture of 65535 x 65535
      lying(6, {0x00, 0x00}),              // a header of no bytes
      lying(6, {0xFF, 0xFF}),
      nested,
      Bytes(200'000, 'P'),
  };
  for (const Bytes &stream : streams) {
    const ServerSocket client = drone.accept();
    sendAll(client, stream);
  } // each connection is closed at its end: a reset where the client has not read it all
  {
    const ServerSocket client = drone.accept(); // byte by byte
    for (const std::uint8_t byte : good)
      if (!sendAll(client, {byte}))
        break;
    expectSeesAgain(link, [&](std::uint32_t number) { sendAll(client, paveFrame(number)); });
  }
  const ServerSocket silent = drone.accept(); // and one that never says anything is given up
  const ServerSocket next = drone.accept();
  expectSeesAgain(link, [&](std::uint32_t number) { sendAll(next, paveFrame(number)); });
  drone.expectNoFlightCommand();
}

TEST(Hostile, NoTrafficMakesTheClientSendAFlightCommand)
{
  for (const int generation : {1, 2}) {
    FakeDrone drone(generation);
    DroneLink link(drone.address());
    const sockaddr_in of_navdata = FakeDrone::clientOf(drone.navdata);
    const sockaddr_in of_video = generation == 1 ? FakeDrone::clientOf(drone.video) : sockaddr_in{};
    ServerSocket stream = generation == 2 ? drone.accept() : ServerSocket();
    std::mt19937 random(static_cast<unsigned>(generation));
    const Bytes picture = generation == 1 ? encodeUvlc(test::stripes(160, 120, 1), 1) : paveFrame(1);
    for (int k = 0; k < 600; ++k) {
      Navdata navdata = packet(static_cast<std::uint32_t>(k + 1));
      navdata.state = static_cast<std::uint32_t>(random()); // emergency, watchdog, bootstrap, flying, in all mixtures
      Bytes bytes = encodeNavdata(navdata);
      if (k % 3 == 0)
        bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
      send(drone.navdata, bytes, of_navdata);
      Bytes spoilt = picture;
      for (int n = 0; n < 4; ++n)
        spoilt[random() % spoilt.size()] = static_cast<std::uint8_t>(random());
      if (generation == 1)
        send(drone.video, spoilt, of_video);
      else if (!sendAll(stream, spoilt))
        stream = drone.accept();
      if (k % 50 == 0)
        std::this_thread::sleep_for(Milliseconds(20)); // until it has read some
      drone.commands();
    }
    EXPECT_TRUE(eventually([&] { return drone.commands().count("CONFIG") > 0; })); // it did listen
    drone.expectNoFlightCommand();
  }
}
