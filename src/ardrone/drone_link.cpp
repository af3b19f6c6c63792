// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/ardrone/drone_link.h>

#include "socket.h"

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <thread>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
constexpr std::array<std::uint8_t, 4> kWakeUp = {1, 0, 0, 0};
constexpr std::size_t kLargestRead = 1 << 16;
constexpr Milliseconds kPoll{50}, kConnect{500};
constexpr std::int64_t kJump_ns = 5'000'000'000;    // no link delays a packet so long
constexpr std::int64_t kKeepAlive_ns = 250'000'000; // the drone's watchdog bites after 2 s
constexpr std::int64_t kWakeAgain_ns = 500'000'000;
constexpr std::int64_t kSecond_ns = 1'000'000'000;
} // namespace

struct DroneLink::State
{
  State(const ArDroneAddress &a, const Options &o, LinkTap t)
      : address(a),
        options(o),
        tap(std::move(t)),
        commands(a.host, a.at_port),
        generation(a.generation),
        video_clock(o.clock),
        navdata_clock(o.clock),
        odometry(o.odometry)
  {
  }

  const ArDroneAddress address;
  const Options options;
  const LinkTap tap;
  AtChannel commands;
  std::atomic<bool> running{true};
  std::atomic<int> generation;
  std::thread video_thread, navdata_thread;

  mutable std::mutex mutex; // guards all below
  std::condition_variable frame_came;
  std::optional<LiveFrame> newest;
  LinkCounters counters;
  ClockFit video_clock, navdata_clock;
  NavdataOdometry odometry;
  std::int64_t last_navdata_ns = 0;
  std::optional<std::int64_t> last_given_stamp_ns;

  // The video thread's own.
  std::optional<ClockUnwrapper> pave_time;
  std::int64_t stamp_shift_ns = 0, last_stamp_ns = 0, last_arrival_ns = 0, fresh_stamp_ns = 0;
  bool has_stamp = false;
  struct Jump
  {
    std::int64_t raw_ns, arrival_ns;
  };
  std::optional<Jump> jumped;
  std::optional<VideoDecoder> decoder;
  int decoder_generation = 0;
  // The navdata thread's own.
  ClockUnwrapper navdata_time{kNavdataTimePeriod_us};
  std::optional<std::uint32_t> last_sequence;

  void seen(LinkChannel channel, std::int64_t arrival_ns, const std::uint8_t *data,
            std::size_t size) const
  {
    if (tap)
      tap(channel, arrival_ns, data, size);
  }

  // -- video

  void runVideo()
  {
    std::vector<std::uint8_t> buffer(kLargestRead);
    while (running) {
      const int wanted = generation;
      if (wanted != 1) {
        if (const Socket socket = Socket::connectTcp(address.host, address.video_port, kConnect);
            socket.valid()) {
          generation = 2;
          receiveStream(socket, buffer);
          continue;
        }
      }
      if (wanted != 2)
        receiveDatagrams(buffer);
      if (running)
        std::this_thread::sleep_for(std::chrono::duration<double>(options.retry_s));
    }
  }

  void connected(VideoDecoder &video)
  {
    video.restart();
    seen(LinkChannel::video_connected, steadyNowNs(), nullptr, 0);
    const std::lock_guard<std::mutex> lock(mutex);
    ++counters.connections;
  }

  bool silent(std::int64_t since_ns) const
  {
    return static_cast<double>(steadyNowNs() - since_ns) * 1e-9 > options.silence_s;
  }

  VideoDecoder &decoderFor(int g)
  {
    if (!decoder || decoder_generation != g) {
      decoder.emplace(g);
      decoder_generation = g;
    }
    return *decoder;
  }
  void receiveStream(const Socket &socket, std::vector<std::uint8_t> &buffer)
  {
    VideoDecoder &video = decoderFor(2);
    connected(video);
    std::int64_t last_data_ns = steadyNowNs();
    while (running && !silent(last_data_ns)) {
      std::size_t size = 0;
      const auto read = socket.receive(buffer.data(), buffer.size(), size, kPoll);
      if (read == Socket::Read::closed)
        return;
      if (read == Socket::Read::data) {
        last_data_ns = steadyNowNs();
        handle(video, buffer.data(), size, last_data_ns);
      }
    }
  }

  void receiveDatagrams(std::vector<std::uint8_t> &buffer)
  {
    const Socket socket = Socket::connectUdp(address.host, address.video_port);
    bool is_connected = false;
    std::int64_t last_data_ns = steadyNowNs(), last_wake_ns = 0;
    while (running && socket.valid() && !silent(last_data_ns)) {
      const std::int64_t now_ns = steadyNowNs();
      if (now_ns - last_wake_ns > kWakeAgain_ns) {
        socket.send(kWakeUp.data(), kWakeUp.size());
        last_wake_ns = now_ns;
      }
      std::size_t size = 0;
      const auto read = socket.receive(buffer.data(), buffer.size(), size, kPoll);
      if (read == Socket::Read::closed && !is_connected && generation == 0)
        return; // nobody listens: perhaps it is a drone 2 after all
      if (read != Socket::Read::data)
        continue;
      last_data_ns = steadyNowNs();
      generation = 1;
      VideoDecoder &video = decoderFor(1);
      if (!is_connected)
        connected(video);
      is_connected = true;
      handle(video, buffer.data(), size, last_data_ns);
    }
  }

  void handle(VideoDecoder &video, const std::uint8_t *data, std::size_t size,
              std::int64_t arrival_ns)
  {
    seen(LinkChannel::video, arrival_ns, data, size);
    for (DecodedFrame &decoded : video.decode(data, size))
      publish(std::move(decoded), video.counters(), arrival_ns);
  }

  /// Drone time of a frame, going on over wraps and reboots.
  std::int64_t stampOf(const DecodedFrame &frame, std::int64_t arrival_ns)
  {
    if (!frame.timestamp_ms)
      return arrival_ns; // an AR.Drone 1 says nothing about time
    if (!pave_time)
      pave_time.emplace(kPaveTimePeriod_ms);
    const std::int64_t raw_ns = pave_time->unwrap(*frame.timestamp_ms) * 1'000'000;
    const std::int64_t expected_ns = last_stamp_ns + arrival_ns - last_arrival_ns;
    if (!has_stamp || std::abs(raw_ns + stamp_shift_ns - expected_ns) <= kJump_ns) {
      jumped.reset();
      return raw_ns + stamp_shift_ns;
    }
    // One frame alone may have a damaged stamp; two that agree are a clock that started anew.
    if (jumped &&
        std::abs(raw_ns - jumped->raw_ns - (arrival_ns - jumped->arrival_ns)) <= kJump_ns) {
      stamp_shift_ns = expected_ns - raw_ns;
      ++counters.clock_jumps;
      jumped.reset();
    }
    else {
      jumped = Jump{raw_ns, arrival_ns};
    }
    return expected_ns;
  }

  void publish(DecodedFrame &&decoded, const VideoDecoder::Counters &video, std::int64_t arrival_ns)
  {
    const std::lock_guard<std::mutex> lock(mutex);
    counters.video = video;
    LiveFrame frame;
    frame.stamp_ns = stampOf(decoded, arrival_ns);
    if (has_stamp && frame.stamp_ns <= last_stamp_ns)
      frame.stamp_ns = last_stamp_ns + 1; // two in a burst, or a damaged stamp
    else if (decoded.status == FrameStatus::ok)
      video_clock.add(frame.stamp_ns, arrival_ns);
    has_stamp = true;
    last_stamp_ns = frame.stamp_ns;
    last_arrival_ns = arrival_ns;
    frame.status = decoded.status;
    frame.message = std::move(decoded.message);
    frame.picture = std::move(decoded.picture);
    frame.number = decoded.number;
    frame.arrival_ns = arrival_ns;
    if (decoded.unchanged)
      frame.unchanged_since_ns = fresh_stamp_ns;
    else if (decoded.status == FrameStatus::ok)
      fresh_stamp_ns = frame.stamp_ns;
    counters.dropped += newest ? 1 : 0;
    newest = std::move(frame);
    frame_came.notify_one();
  }

  // -- navdata

  void runNavdata()
  {
    std::vector<std::uint8_t> buffer(kLargestRead);
    const Socket socket = Socket::connectUdp(address.host, address.navdata_port);
    std::int64_t last_wake_ns = 0, last_alive_ns = 0, last_config_ns = 0, last_data_ns = 0;
    while (running) {
      const std::int64_t now_ns = steadyNowNs();
      if (now_ns - last_data_ns > kWakeAgain_ns && now_ns - last_wake_ns > kWakeAgain_ns) {
        socket.send(kWakeUp.data(), kWakeUp.size());
        last_wake_ns = now_ns;
      }
      if (now_ns - last_alive_ns > kKeepAlive_ns) {
        commands.resetWatchdog();
        last_alive_ns = now_ns;
      }
      std::size_t size = 0;
      const auto read = socket.receive(buffer.data(), buffer.size(), size, kPoll);
      if (read == Socket::Read::closed)
        std::this_thread::sleep_for(kPoll); // the drone is not up yet
      if (read != Socket::Read::data)
        continue;
      last_data_ns = steadyNowNs();
      seen(LinkChannel::navdata, last_data_ns, buffer.data(), size);
      const std::optional<std::uint32_t> state = takeNavdata(buffer.data(), size, last_data_ns);
      if (state && last_data_ns - last_config_ns > kWakeAgain_ns && asksForConfig(*state)) {
        commands.config("general:navdata_demo", options.full_navdata ? "FALSE" : "TRUE");
        commands.acknowledgeConfig();
        last_config_ns = last_data_ns;
      }
    }
  }

  bool asksForConfig(std::uint32_t bits) const
  {
    const auto has = [bits](DroneState bit) {
      return (bits & static_cast<std::uint32_t>(bit)) != 0;
    };
    return has(DroneState::bootstrap) || has(DroneState::demo_mode) == options.full_navdata;
  }

  /// \return the state bits of a good packet.
  std::optional<std::uint32_t> takeNavdata(const std::uint8_t *data, std::size_t size,
                                           std::int64_t arrival_ns)
  {
    Navdata navdata;
    const NavdataError error = parseNavdata(data, size, navdata);
    const std::lock_guard<std::mutex> lock(mutex);
    if (error != NavdataError::none) {
      ++counters.navdata_refused;
      return std::nullopt;
    }
    if (last_sequence && navdata.sequence <= *last_sequence) {
      const bool restart = navdata.sequence == 1 || arrival_ns - last_navdata_ns > kSecond_ns;
      if (!restart) {
        ++counters.navdata_late;
        return std::nullopt;
      }
      ++counters.navdata_restarts;
      navdata_time.reset();
      navdata_clock.reset();
      odometry.restart();
    }
    last_sequence = navdata.sequence;
    last_navdata_ns = arrival_ns;
    ++counters.navdata_packets;
    if (navdata.demo) {
      // Demo packets have no time: then the arrival must do.
      const std::int64_t stamp_ns =
          navdata.time ? navdata_time.unwrap(navdataTimeMicroseconds(*navdata.time)) * 1000
                       : arrival_ns;
      if (!navdata_clock.add(stamp_ns, arrival_ns))
        odometry.restart();
      odometry.add(stamp_ns, navdata);
    }
    return navdata.state;
  }

  // -- together, with the mutex held

  std::int64_t videoToNavdata(std::int64_t stamp_ns) const
  {
    return navdata_clock.toDrone(video_clock.toHost(stamp_ns) -
                                 static_cast<std::int64_t>(address.video_delay_s * 1e9));
  }

  /// A picture that stays while the body moves is no picture of now.
  void checkFrozen(LiveFrame &frame) const
  {
    if (frame.status != FrameStatus::ok || !frame.unchanged_since_ns || !frame.body)
      return;
    const auto then = odometry.at(videoToNavdata(*frame.unchanged_since_ns));
    if (!then)
      return;
    const Vector6d moved = frame.body->wMb.minus(then->wMb);
    if (moved.head<3>().norm() > options.frozen_m || moved.tail<3>().norm() > options.frozen_rad) {
      frame.status = FrameStatus::stale;
      frame.message = "the picture stays though the body moves";
    }
  }

  void addNavdata(LiveFrame &frame) const
  {
    if (!navdata_clock.isReady() || !video_clock.isReady())
      return;
    const std::int64_t exposed_ns = videoToNavdata(frame.stamp_ns);
    const std::int64_t shift_ns = frame.stamp_ns - exposed_ns;
    frame.body = odometry.at(exposed_ns);
    if (frame.body)
      frame.body->stamp_ns = frame.stamp_ns;
    if (!last_given_stamp_ns)
      return;
    const std::int64_t before_ns = *last_given_stamp_ns - shift_ns;
    frame.gyro = odometry.gyro(before_ns, exposed_ns);
    for (GyroSample &sample : frame.gyro)
      sample.stamp_ns += shift_ns;
    if (frame.body)
      frame.odometry_covariance = odometry.stepCovariance(before_ns, exposed_ns);
  }
};

void DroneLink::Options::validate() const
{
  if (!(silence_s > 0.1 && silence_s < 30))
    throw vpException(vpException::badValue, "silence_s = %g, must be in (0.1, 30) s", silence_s);
  if (!(retry_s > 0.01 && retry_s < 5))
    throw vpException(vpException::badValue, "retry_s = %g, must be in (0.01, 5) s", retry_s);
  if (!(frozen_m > 0 && frozen_m < 10))
    throw vpException(vpException::badValue, "frozen_m = %g, must be in (0, 10) m", frozen_m);
  if (!(frozen_rad > 0 && frozen_rad < 3))
    throw vpException(vpException::badValue, "frozen_rad = %g, must be in (0, 3) rad", frozen_rad);
  odometry.validate();
  clock.validate();
}

DroneLink::DroneLink(const ArDroneAddress &address) : DroneLink(address, Options{}) {}

DroneLink::DroneLink(const ArDroneAddress &address, const Options &options, LinkTap tap)
{
  options.validate();
  m_state = std::make_unique<State>(address, options, std::move(tap));
  m_state->video_thread = std::thread([this] { m_state->runVideo(); });
  m_state->navdata_thread = std::thread([this] { m_state->runNavdata(); });
}

DroneLink::~DroneLink()
{
  m_state->running = false;
  m_state->video_thread.join();
  m_state->navdata_thread.join();
}

bool DroneLink::next(LiveFrame &frame, double timeout_s)
{
  std::unique_lock<std::mutex> lock(m_state->mutex);
  const bool came = m_state->frame_came.wait_for(lock, std::chrono::duration<double>(timeout_s),
                                                 [this] { return m_state->newest.has_value(); });
  if (!came)
    return false;
  frame = std::move(*m_state->newest);
  m_state->newest.reset();
  m_state->addNavdata(frame);
  m_state->checkFrozen(frame);
  m_state->counters.frozen += frame.status == FrameStatus::stale ? 1 : 0;
  m_state->last_given_stamp_ns = frame.stamp_ns;
  ++m_state->counters.delivered;
  return true;
}

std::optional<BodyState> DroneLink::body() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  if (steadyNowNs() - m_state->last_navdata_ns > kSecond_ns)
    return std::nullopt;
  return m_state->odometry.newest();
}

int DroneLink::generation() const { return m_state->generation; }
LinkCounters DroneLink::counters() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  return m_state->counters;
}
AtChannel &DroneLink::commands() { return m_state->commands; }
const ArDroneAddress &DroneLink::address() const { return m_state->address; }
} // namespace bole
