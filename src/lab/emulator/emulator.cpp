// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/emulator.h"

#include "support/text.h"

#include "emulator/emulator_packets.h"
#include "emulator/emulator_wire.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <fmt/format.h>
#include <mutex>
#include <random>
#include <thread>

namespace bole
{
namespace
{
constexpr std::size_t kMostCommands = 100'000;
constexpr std::int64_t kSecond_ns = 1'000'000'000, kWatchdog_ns = 2 * kSecond_ns;
constexpr std::chrono::milliseconds kTick{2};
constexpr std::uint32_t kEmergencyBit = 1u << 8, kTakeOffBit = 1u << 9;

std::int64_t nanoseconds(double s) { return static_cast<std::int64_t>(s * 1e9); }

std::int64_t steadyNowNs()
{
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

bool within(std::int64_t now_ns, double from_s, double for_s)
{
  return from_s >= 0 && now_ns >= nanoseconds(from_s) && now_ns < nanoseconds(from_s + for_s);
}
} // namespace

/// Flies the feed in the serving thread, and injects the faults.
struct ArDroneEmulator::State
{
  using Port = DroneWire::Port;

  std::unique_ptr<PacketFeed> feed;
  const Options options;
  const int generation;
  std::thread thread;
  std::atomic<bool> running{false};

  mutable std::mutex mutex; // guards counters, received, finished
  std::condition_variable ended;
  Counters counters;
  std::vector<AtCommand> received;
  bool finished = false;

  // The serving thread's own.
  DroneWire wire;
  DronePackets packets;
  std::mt19937 random;
  bool rebooted = false, ground = false, emergency = false;
  std::int64_t last_command_ns = 0, last_sequence = 0;
  std::int64_t start_ns = -1; // host's clock at flight time 0
  vpImage<unsigned char> frozen;

  State(std::unique_ptr<PacketFeed> f, const Options &o)
      : feed(std::move(f)),
        options(o),
        generation(feed->generation()),
        wire(generation, o.navdata_port, o.video_port, o.at_port),
        packets(feed->generation(), feed->frameRateHz(), o),
        random(o.seed)
  {
  }

  double chance() { return std::uniform_real_distribution<double>(0, 1)(random); }

  // -- serving

  void serve()
  {
    FeedPacket packet;
    bool has_packet = false, has_more = true;
    while (running && (has_more || !wire.isIdle())) {
      service();
      if (!has_packet && has_more) {
        has_packet = has_more = feed->next(packet);
        if (has_packet)
          prepare(packet); // encoding must not delay the sending
      }
      const std::int64_t now_ns = steadyNowNs();
      if (start_ns < 0 && readyToStart(now_ns))
        begin(now_ns);
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

  void begin(std::int64_t now_ns)
  {
    start_ns = now_ns;
    const std::lock_guard<std::mutex> lock(mutex);
    counters.started_ns = now_ns;
  }

  bool readyToStart(std::int64_t now_ns) const
  {
    return wire.hasVideoListener() &&
           ((wire.hasNavdataListener() && packets.isConfigured()) || now_ns - wire.videoSinceNs() > kSecond_ns / 2);
  }

  std::int64_t flightTime(std::int64_t now_ns) const
  {
    return start_ns < 0 ? 0 : static_cast<std::int64_t>(static_cast<double>(now_ns - start_ns) * options.speed);
  }

  /// Sleeps until something comes, or is due.
  void wait(std::int64_t next_sent_ns)
  {
    auto pause = std::chrono::nanoseconds(kTick);
    if (next_sent_ns >= 0) {
      const double left_ns = static_cast<double>(next_sent_ns - flightTime(steadyNowNs())) / options.speed;
      pause = std::min(pause, std::chrono::nanoseconds(static_cast<std::int64_t>(std::max(0.0, left_ns))));
    }
    if (pause.count() > 0)
      std::this_thread::sleep_for(pause);
  }

  void service()
  {
    const std::int64_t now_ns = steadyNowNs();
    const bool is_down = start_ns >= 0 && rebooting(flightTime(now_ns));
    const DroneWire::Received came = wire.receive(now_ns, is_down);
    for (const std::string &text : came.commands)
      for (AtCommand &command : parseAtCommands(text))
        obey(std::move(command), now_ns);
    if (came.navdata_asked && !packets.isConfigured())
      sendNavdata({}, flightTime(now_ns)); // bootstrap: says only that it is there
    sendDue(now_ns);
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
    if (command.name == "CONFIG" && command.arguments.size() == 2 && command.arguments[0] == "general:navdata_demo")
      packets.configure(command.arguments[1] == "FALSE");
    if (command.name == "REF" && !command.arguments.empty()) {
      const auto bits = static_cast<std::uint32_t>(std::strtol(command.arguments[0].c_str(), nullptr, 10));
      ground = (bits & kTakeOffBit) == 0;
      emergency = emergency != ((bits & kEmergencyBit) != 0);
    }
    if (received.size() < kMostCommands)
      received.push_back(std::move(command));
  }

  // -- sending

  /// Encodes a picture, the one that the camera froze on where it did.
  void prepare(FeedPacket &packet)
  {
    if (packet.kind != FeedPacket::Kind::picture)
      return;
    const bool is_frozen = within(packet.stamp_ns, options.freeze_at_s, options.freeze_for_s);
    if (is_frozen && frozen.getSize() == 0)
      frozen = packet.image;
    if (is_frozen)
      count(&Counters::frozen);
    packet.bytes = packets.picture(is_frozen ? frozen : packet.image, packet.stamp_ns);
  }

  void launch(const FeedPacket &packet)
  {
    const std::int64_t now_ns = packet.sent_ns;
    if (!rebooted && options.reboot_at_s >= 0 && now_ns >= nanoseconds(options.reboot_at_s))
      goDown(now_ns);
    if (rebooting(now_ns)) {
      packets.forgetPicture();
      return;
    }
    wire.comeUp();
    {
      const std::lock_guard<std::mutex> lock(mutex);
      counters.flight_s = static_cast<double>(now_ns) * 1e-9;
    }
    switch (packet.kind) {
    case FeedPacket::Kind::picture:
      if (within(packet.stamp_ns, options.stall_at_s, options.stall_for_s))
        count(&Counters::stalled);
      else
        post(Port::video, packet.bytes, &Counters::frames);
      break;
    case FeedPacket::Kind::navdata:
      sendNavdata(packet.navdata, packet.stamp_ns);
      break;
    case FeedPacket::Kind::raw_video:
      post(Port::video, packet.bytes, &Counters::frames);
      break;
    case FeedPacket::Kind::raw_navdata:
      post(Port::navdata, packet.bytes, &Counters::navdata);
      break;
    case FeedPacket::Kind::video_connected: // the recorded client connected anew: so must ours
      if (packet.sent_ns > 0)
        wire.closeVideoClient();
      break;
    }
  }

  bool rebooting(std::int64_t now_ns) const
  {
    return within(now_ns, options.reboot_at_s, options.reboot_for_s * options.speed);
  }

  void goDown(std::int64_t now_ns)
  {
    rebooted = true;
    wire.goDown();
    packets.reboot(now_ns + nanoseconds(options.reboot_for_s * options.speed));
    last_sequence = 0;
    count(&Counters::reboots);
  }

  void count(std::size_t Counters::*counter, std::size_t times = 1)
  {
    const std::lock_guard<std::mutex> lock(mutex);
    counters.*counter += times;
  }

  void sendNavdata(const Navdata &navdata, std::int64_t stamp_ns)
  {
    if (!wire.hasNavdataListener())
      return;
    DronePackets::Condition condition{ground, emergency, false};
    condition.command_watchdog = last_command_ns != 0 && steadyNowNs() - last_command_ns > kWatchdog_ns;
    auto bytes = packets.status(navdata, stamp_ns, condition);
    if (!bytes.empty())
      post(Port::navdata, std::move(bytes), &Counters::navdata);
  }

  /// Sends \p bytes, or what the faults leave of them.
  void post(Port port, std::vector<std::uint8_t> bytes, std::size_t Counters::*counter)
  {
    count(counter);
    if (options.loss > 0 && chance() < options.loss)
      return count(&Counters::lost);
    if (options.corrupt > 0 && chance() < options.corrupt) {
      const int changes = std::uniform_int_distribution<int>(1, 4)(random);
      for (int i = 0; i < changes; ++i)
        bytes[std::uniform_int_distribution<std::size_t>(0, bytes.size() - 1)(random)] ^=
            static_cast<std::uint8_t>(std::uniform_int_distribution<int>(1, 255)(random));
      count(port == Port::video ? &Counters::corrupted_frames : &Counters::corrupted_navdata);
    }
    wire.post(port, std::move(bytes), steadyNowNs() + nanoseconds(options.jitter_s * chance()));
    sendDue(steadyNowNs());
  }

  void sendDue(std::int64_t now_ns) { count(&Counters::refused, wire.sendDue(now_ns)); }
};

void ArDroneEmulator::Options::validate() const
{
  requireRange("speed", speed, 1, 20);
  requireRange("bit_rate", bit_rate, 1e4, 1e8);
  requireRange("key_interval", key_interval, 1, 300);
  requireRange("loss", loss, 0, 0.99);
  requireRange("jitter_s", jitter_s, 0, 1);
  requireRange("corrupt", corrupt, 0, 0.99);
  requireRange("reboot_for_s", reboot_for_s, 0, 60);
  requireRange("freeze_for_s", freeze_for_s, 0, 3600);
  requireRange("stall_for_s", stall_for_s, 0, 3600);
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
  return m_state->ended.wait_for(lock, std::chrono::duration<double>(timeout_s), [this] { return m_state->finished; });
}

std::string ArDroneEmulator::address() const
{
  const DroneWire &wire = m_state->wire;
  return fmt::format("ardrone://127.0.0.1?navdata={}&video={}&at={}&generation={}", wire.navdataPort(),
                     wire.videoPort(), wire.atPort(), m_state->generation);
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
