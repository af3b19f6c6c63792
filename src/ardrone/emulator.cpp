// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/ardrone/drone_clock.h>
#include <bole/ardrone/emulator.h>
#include <bole/ardrone/h264.h>
#include <bole/ardrone/pave.h>
#include <bole/ardrone/uvlc.h>

#include "socket.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <map>
#include <mutex>
#include <random>
#include <thread>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
constexpr std::size_t kDatagram = 1 << 16, kMostCommands = 100'000, kMostPending = 1 << 20;
constexpr std::int64_t kSecond_ns = 1'000'000'000, kWatchdog_ns = 2 * kSecond_ns,
                       kClientLost_ns = 10 * kSecond_ns;
constexpr std::int64_t kWrapSoon_ms = 3000, kDemoEvery_ns = kSecond_ns / 15;
constexpr std::uint32_t kUsualState =
    0x0f800080 | 0x10; // threads up, camera ready, altitude control
constexpr Milliseconds kTick{2};
constexpr std::uint32_t kLanded = 2, kFlying = 3, kEmergencyBit = 1u << 8, kTakeOffBit = 1u << 9;
} // namespace

struct ArDroneEmulator::State
{
  enum class Port
  {
    video,
    navdata
  };
  struct Outgoing
  {
    Port port;
    std::vector<std::uint8_t> bytes;
  };

  std::unique_ptr<PacketFeed> feed;
  Options options;
  int generation = 2;
  std::thread thread;
  std::atomic<bool> running{false};

  mutable std::mutex mutex; // guards counters, received, finished
  std::condition_variable ended;
  Counters counters;
  std::vector<AtCommand> received;
  bool finished = false;

  // The serving thread's own.
  Socket navdata_socket, at_socket, video_socket, video_client;
  std::optional<sockaddr_in> navdata_client, video_peer;
  std::int64_t navdata_seen_ns = 0, video_seen_ns = 0, video_since_ns = 0;
  std::vector<std::uint8_t> pending; // of the TCP client
  std::multimap<std::int64_t, Outgoing> queue;
  std::int64_t last_video_due_ns = 0;
  std::mt19937 random;
  bool configured = false, wants_full = false, rebooted = false, ground = false, emergency = false;
  std::int64_t last_command_ns = 0, last_demo_ns = -kSecond_ns;
  std::int64_t last_sequence = 0;
  std::int64_t start_ns = -1; // host's clock at flight time 0
  std::int64_t boot_ns = 0;   // flight time of the last boot
  std::int64_t clock_ms = 100'000, navdata_clock_us = 50'000'000;
  std::uint32_t frame_number = 0, navdata_sequence = 0, stream_position = 0;
  std::unique_ptr<H264Encoder> encoder;
  bool force_key = true;
  vpImage<unsigned char> frozen;

  State(std::unique_ptr<PacketFeed> f, const Options &o)
      : feed(std::move(f)), options(o), generation(feed->generation()), random(o.seed)
  {
    navdata_socket = Socket::bindUdp(o.host, o.navdata_port);
    at_socket = Socket::bindUdp(o.host, o.at_port);
    listenVideo();
    if (o.clock_wrap) {
      clock_ms = kPaveTimePeriod_ms - kWrapSoon_ms;
      navdata_clock_us = kNavdataTimePeriod_us - kWrapSoon_ms * 1000;
    }
  }

  void listenVideo()
  {
    video_socket = generation == 2 ? Socket::listenTcp(options.host, options.video_port)
                                   : Socket::bindUdp(options.host, options.video_port);
    if (options.video_port == 0) // once: the same again after a reboot
      options.video_port = video_socket.localPort();
  }

  double chance() { return std::uniform_real_distribution<double>(0, 1)(random); }

  // -- serving

  void serve()
  {
    FeedPacket packet;
    bool has_packet = false, has_more = true;
    while (running && (has_more || !queue.empty() || !pending.empty())) {
      service();
      if (!has_packet && has_more) {
        has_packet = has_more = feed->next(packet);
        if (has_packet)
          prepare(packet); // encoding must not delay the sending
      }
      const std::int64_t now_ns = steadyNowNs();
      if (start_ns < 0 && readyToStart(now_ns))
        start_ns = now_ns;
      if (has_packet && start_ns >= 0 && flightTime(now_ns) >= packet.sent_ns) {
        launch(packet);
        has_packet = false;
        continue; // the next may be due already
      }
      wait(has_packet && start_ns >= 0 ? packet.sent_ns : -1);
    }
    sendDue(steadyNowNs() + kSecond_ns);
    const std::lock_guard<std::mutex> lock(mutex);
    finished = true;
    ended.notify_all();
  }

  bool readyToStart(std::int64_t now_ns) const
  {
    const bool video = video_client.valid() || video_peer.has_value();
    return video && ((navdata_client && configured) || now_ns - video_since_ns > kSecond_ns / 2);
  }

  std::int64_t flightTime(std::int64_t now_ns) const
  {
    return start_ns < 0
               ? 0
               : static_cast<std::int64_t>(static_cast<double>(now_ns - start_ns) * options.speed);
  }

  /// Sleeps until something comes, or is due.
  void wait(std::int64_t next_sent_ns)
  {
    auto pause = std::chrono::nanoseconds(kTick);
    if (next_sent_ns >= 0) {
      const double left_ns =
          static_cast<double>(next_sent_ns - flightTime(steadyNowNs())) / options.speed;
      pause = std::min(pause,
                       std::chrono::nanoseconds(static_cast<std::int64_t>(std::max(0.0, left_ns))));
    }
    if (pause.count() > 0)
      std::this_thread::sleep_for(pause);
  }

  void service()
  {
    std::array<std::uint8_t, 2048> buffer{};
    std::size_t size = 0;
    sockaddr_in sender = {};
    const std::int64_t now_ns = steadyNowNs();
    while (navdata_socket.receiveFrom(buffer.data(), buffer.size(), size, sender,
                                      Milliseconds(0)) == Socket::Read::data) {
      if (isDown(now_ns))
        continue;
      navdata_client = sender;
      navdata_seen_ns = now_ns;
      if (!configured)
        sendNavdata({}, flightTime(now_ns)); // bootstrap: says only that it is there
    }
    while (at_socket.receiveFrom(buffer.data(), buffer.size(), size, sender, Milliseconds(0)) ==
           Socket::Read::data) {
      if (isDown(now_ns))
        continue;
      navdata_seen_ns = now_ns;
      for (AtCommand &command : parseAtCommands(
               std::string(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size))))
        obey(std::move(command), now_ns);
    }
    serviceVideo(now_ns);
    if (navdata_client && now_ns - navdata_seen_ns > kClientLost_ns)
      navdata_client.reset();
    sendDue(now_ns);
  }

  void serviceVideo(std::int64_t now_ns)
  {
    if (!video_socket.valid())
      return; // rebooting
    if (generation == 2) {
      if (video_socket.waitReadable(Milliseconds(0)))
        if (Socket client = video_socket.accept(); client.valid()) {
          video_client = std::move(client);
          pending.clear();
          video_since_ns = now_ns;
        }
      return;
    }
    std::array<std::uint8_t, 64> buffer{};
    std::size_t size = 0;
    sockaddr_in sender = {};
    while (video_socket.receiveFrom(buffer.data(), buffer.size(), size, sender, Milliseconds(0)) ==
           Socket::Read::data) {
      if (!video_peer)
        video_since_ns = now_ns;
      video_peer = sender;
      video_seen_ns = now_ns;
    }
    if (video_peer && now_ns - video_seen_ns > kClientLost_ns)
      video_peer.reset();
  }

  void obey(AtCommand &&command, std::int64_t now_ns)
  {
    const std::lock_guard<std::mutex> lock(mutex);
    if (command.sequence <= last_sequence && command.sequence != 1) {
      ++counters.out_of_sequence;
      return;
    }
    last_sequence = command.sequence;
    last_command_ns = now_ns;
    if (command.name == "CONFIG" && command.arguments.size() == 2 &&
        command.arguments[0] == "general:navdata_demo") {
      configured = true;
      wants_full = command.arguments[1] == "FALSE";
    }
    if (command.name == "REF" && !command.arguments.empty()) {
      const auto bits =
          static_cast<std::uint32_t>(std::strtol(command.arguments[0].c_str(), nullptr, 10));
      ground = (bits & kTakeOffBit) == 0;
      emergency = emergency != ((bits & kEmergencyBit) != 0);
    }
    if (received.size() < kMostCommands)
      received.push_back(std::move(command));
  }

  // -- sending

  void launch(const FeedPacket &packet)
  {
    const std::int64_t now_ns = packet.sent_ns;
    if (!rebooted && options.reboot_at_s >= 0 && now_ns >= seconds(options.reboot_at_s))
      goDown(now_ns);
    if (rebooting(now_ns)) {
      frame_number = stream_position = 0;
      force_key = true;
      return;
    }
    if (!video_socket.valid())
      listenVideo();
    {
      const std::lock_guard<std::mutex> lock(mutex);
      counters.flight_s = static_cast<double>(now_ns) * 1e-9;
    }
    switch (packet.kind) {
    case FeedPacket::Kind::picture:
      sendPicture(packet);
      break;
    case FeedPacket::Kind::navdata:
      sendNavdata(packet.navdata, packet.stamp_ns);
      break;
    case FeedPacket::Kind::raw_video:
      post(Port::video, packet.bytes);
      count(&Counters::frames);
      break;
    case FeedPacket::Kind::raw_navdata:
      post(Port::navdata, packet.bytes);
      count(&Counters::navdata);
      break;
    case FeedPacket::Kind::video_connected: // the recorded client connected anew: so must ours
      if (packet.sent_ns > 0)
        video_client.close();
      break;
    }
  }

  static std::int64_t seconds(double s) { return static_cast<std::int64_t>(s * 1e9); }
  static bool within(std::int64_t now_ns, double from_s, double for_s)
  {
    return from_s >= 0 && now_ns >= seconds(from_s) && now_ns < seconds(from_s + for_s);
  }
  bool isDown(std::int64_t now_ns) const { return start_ns >= 0 && rebooting(flightTime(now_ns)); }
  bool rebooting(std::int64_t now_ns) const
  {
    return within(now_ns, options.reboot_at_s, options.reboot_for_s * options.speed);
  }

  void count(std::size_t Counters::*counter)
  {
    const std::lock_guard<std::mutex> lock(mutex);
    ++(counters.*counter);
  }

  void goDown(std::int64_t now_ns)
  {
    rebooted = true;
    video_client.close();
    video_socket.close();
    video_peer.reset();
    navdata_client.reset();
    pending.clear();
    queue.clear();
    configured = false;
    boot_ns = now_ns + seconds(options.reboot_for_s * options.speed);
    clock_ms = 0;
    navdata_clock_us = 0;
    frame_number = navdata_sequence = stream_position = 0;
    last_sequence = 0;
    force_key = true;
    count(&Counters::reboots);
  }

  void post(Port port, std::vector<std::uint8_t> bytes)
  {
    if (options.loss > 0 && chance() < options.loss)
      return count(&Counters::lost);
    const bool may = port == Port::video ? options.corrupt_video : options.corrupt_navdata;
    if (may && options.corrupt > 0 && chance() < options.corrupt) {
      const int changes = std::uniform_int_distribution<int>(1, 4)(random);
      for (int i = 0; i < changes; ++i)
        bytes[std::uniform_int_distribution<std::size_t>(0, bytes.size() - 1)(random)] ^=
            static_cast<std::uint8_t>(std::uniform_int_distribution<int>(1, 255)(random));
      count(port == Port::video ? &Counters::corrupted_frames : &Counters::corrupted_navdata);
    }
    std::int64_t due_ns = steadyNowNs() + seconds(options.jitter_s * chance());
    if (port == Port::video && generation == 2) // a stream keeps its order
      due_ns = last_video_due_ns = std::max(due_ns, last_video_due_ns);
    queue.emplace(due_ns, Outgoing{port, std::move(bytes)});
    sendDue(steadyNowNs());
  }

  void sendDue(std::int64_t now_ns)
  {
    flush();
    while (!queue.empty() && queue.begin()->first <= now_ns) {
      const Outgoing out = std::move(queue.begin()->second);
      queue.erase(queue.begin());
      if (out.port == Port::navdata) {
        if (navdata_client)
          navdata_socket.sendTo(out.bytes.data(), out.bytes.size(), *navdata_client);
      }
      else if (generation == 1) {
        if (video_peer && video_socket.valid())
          video_socket.sendTo(out.bytes.data(), out.bytes.size(), *video_peer);
      }
      else if (video_client.valid()) {
        if (pending.size() + out.bytes.size() > kMostPending) {
          count(&Counters::refused);
          continue;
        }
        pending.insert(pending.end(), out.bytes.begin(), out.bytes.end());
        flush();
      }
    }
  }

  void flush()
  {
    if (pending.empty())
      return;
    if (!video_client.valid()) {
      pending.clear();
      return;
    }
    const std::int64_t sent = video_client.sendSome(pending.data(), pending.size());
    if (sent < 0) {
      video_client.close();
      pending.clear();
      return;
    }
    pending.erase(pending.begin(), pending.begin() + static_cast<std::ptrdiff_t>(sent));
  }

  void prepare(FeedPacket &packet)
  {
    if (packet.kind != FeedPacket::Kind::picture)
      return;
    vpImage<unsigned char> image = packet.image;
    if (within(packet.stamp_ns, options.freeze_at_s, options.freeze_for_s)) {
      if (frozen.getSize() == 0)
        frozen = image;
      image = frozen;
      count(&Counters::frozen);
    }
    ++frame_number;
    packet.bytes =
        generation == 1 ? encodeUvlc(image, frame_number) : encodeFrame(image, packet.stamp_ns);
  }

  void sendPicture(const FeedPacket &packet)
  {
    if (within(packet.stamp_ns, options.stall_at_s, options.stall_for_s))
      return count(&Counters::stalled);
    post(Port::video, packet.bytes);
    count(&Counters::frames);
  }

  std::vector<std::uint8_t> encodeFrame(const vpImage<unsigned char> &image, std::int64_t stamp_ns)
  {
    const int width = static_cast<int>(image.getWidth()),
              height = static_cast<int>(image.getHeight());
    if (!encoder) {
      encoder = std::make_unique<H264Encoder>(width, height, feed->frameRateHz(), options.bit_rate,
                                              options.key_interval);
    }
    const auto encoded = encoder->encode(image, force_key);
    force_key = false;
    PaveHeader header;
    header.payload_size = header.advertised_size = static_cast<std::uint32_t>(encoded.bytes.size());
    header.coded_width = static_cast<std::uint16_t>(encoder->codedWidth());
    header.coded_height = static_cast<std::uint16_t>(encoder->codedHeight());
    header.display_width = static_cast<std::uint16_t>(width);
    header.display_height = static_cast<std::uint16_t>(height);
    header.frame_number = frame_number;
    header.timestamp_ms = static_cast<std::uint32_t>(clock_ms + (stamp_ns - boot_ns) / 1'000'000);
    header.frame_type = encoded.is_key ? PaveFrameType::idr : PaveFrameType::p;
    header.stream_position = stream_position;
    header.header1_size = encoded.sps_size;
    header.header2_size = encoded.pps_size;
    stream_position += header.payload_size;
    auto bytes = encodePaveHeader(header);
    bytes.insert(bytes.end(), encoded.bytes.begin(), encoded.bytes.end());
    return bytes;
  }

  void sendNavdata(Navdata navdata, std::int64_t stamp_ns)
  {
    if (!navdata_client)
      return;
    if (configured && !wants_full && stamp_ns - last_demo_ns < kDemoEvery_ns)
      return;
    last_demo_ns = stamp_ns;
    navdata.state = kUsualState | (ground ? 0u : 1u);
    const auto raise = [&](DroneState bit, bool on) {
      navdata.state |= on ? static_cast<std::uint32_t>(bit) : 0u;
    };
    raise(DroneState::bootstrap, !configured);
    raise(DroneState::demo_mode, configured && !wants_full);
    raise(DroneState::command_watchdog,
          last_command_ns != 0 && steadyNowNs() - last_command_ns > kWatchdog_ns);
    raise(DroneState::emergency, emergency);
    navdata.sequence = ++navdata_sequence;
    if (!configured) {
      navdata.demo.reset();
      navdata.physical.reset();
    }
    else if (!wants_full) {
      navdata.physical.reset();
    }
    else {
      navdata.time = navdataTimeWord(navdata_clock_us + (stamp_ns - boot_ns) / 1000);
    }
    if (navdata.demo)
      navdata.demo->control_state = (ground ? kLanded : kFlying) << 16;
    post(Port::navdata, encodeNavdata(navdata));
    count(&Counters::navdata);
  }
};

void ArDroneEmulator::Options::validate() const
{
  const auto require = [](const char *name, double value, double low, double high) {
    if (!(value >= low && value <= high))
      throw vpException(vpException::badValue, "%s = %g, must be in [%g, %g]", name, value, low,
                        high);
  };
  require("speed", speed, 1, 20);
  require("bit_rate", bit_rate, 1e4, 1e8);
  require("key_interval", key_interval, 1, 300);
  require("loss", loss, 0, 0.99);
  require("jitter_s", jitter_s, 0, 1);
  require("corrupt", corrupt, 0, 0.99);
  require("reboot_for_s", reboot_for_s, 0, 60);
  require("freeze_for_s", freeze_for_s, 0, 3600);
  require("stall_for_s", stall_for_s, 0, 3600);
}

ArDroneEmulator::ArDroneEmulator(std::unique_ptr<PacketFeed> feed, const Options &options)
{
  options.validate();
  m_state = std::make_unique<State>(std::move(feed), options);
}

ArDroneEmulator::~ArDroneEmulator() { stop(); }

void ArDroneEmulator::start()
{
  if (m_state->thread.joinable())
    return;
  m_state->running = true;
  m_state->thread = std::thread([this] { m_state->serve(); });
}

void ArDroneEmulator::stop()
{
  m_state->running = false;
  if (m_state->thread.joinable())
    m_state->thread.join();
}

bool ArDroneEmulator::wait(double timeout_s)
{
  std::unique_lock<std::mutex> lock(m_state->mutex);
  return m_state->ended.wait_for(lock, std::chrono::duration<double>(timeout_s),
                                 [this] { return m_state->finished; });
}

ArDroneAddress ArDroneEmulator::address() const
{
  ArDroneAddress address;
  address.host = m_state->options.host;
  address.navdata_port = m_state->navdata_socket.localPort();
  address.at_port = m_state->at_socket.localPort();
  address.video_port = m_state->options.video_port;
  address.generation = m_state->generation;
  return address;
}

ArDroneEmulator::Counters ArDroneEmulator::counters() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  return m_state->counters;
}

std::vector<AtCommand> ArDroneEmulator::commands() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  return m_state->received;
}
} // namespace bole
