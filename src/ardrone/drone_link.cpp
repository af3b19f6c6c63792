// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/drone_link.h"

#include "ardrone/drone_clock.h"
#include "ardrone/receivers.h"
#include "input/steady_clock.h"

#include <condition_variable>
#include <cstring>
#include <fmt/format.h>
#include <mutex>

namespace bole
{
namespace
{
constexpr std::int64_t kSilence_ns = 1'000'000'000;
constexpr double kFrozen_m = 0.1;    // a motion that no scene among trees can hide
constexpr double kFrozen_rad = 0.02; // 4 px at 320 columns
} // namespace

/// What the two receiving threads bring together for the consumer.
struct DroneLink::State
{
  explicit State(const ArDroneAddress &a) : address(a), commands(a.host, a.at_port) {}

  const ArDroneAddress address;
  AtChannel commands;

  mutable std::mutex mutex; // guards all below but the receivers
  std::condition_variable frame_came;
  std::optional<LiveFrame> newest;
  LinkCounters counters;
  ClockFit video_clock, navdata_clock;
  ClockRate video_rate, navdata_rate;
  VideoStamps stamps;
  std::int64_t fresh_stamp_ns = 0;
  ClockUnwrapper navdata_time{kNavdataTimePeriod_us};
  std::optional<std::uint32_t> last_sequence;
  std::int64_t last_navdata_ns = 0;
  NavdataOdometry odometry;
  std::optional<std::int64_t> last_given_stamp_ns;

  std::unique_ptr<VideoReceiver> video_receiver; // last: their threads end before the rest goes
  std::unique_ptr<NavdataReceiver> navdata_receiver;

  void start(const LinkTap &tap)
  {
    VideoReceiver::Callbacks of_video;
    of_video.tap = tap;
    of_video.connected = [this] {
      const std::lock_guard<std::mutex> lock(mutex);
      ++counters.connections;
    };
    of_video.frame = [this](DecodedFrame &&frame, std::int64_t arrival_ns) { publish(std::move(frame), arrival_ns); };
    of_video.counted = [this](const DroneVideoDecoder::Counters &counted) {
      const std::lock_guard<std::mutex> lock(mutex);
      counters.video = counted;
    };
    NavdataReceiver::Callbacks of_navdata;
    of_navdata.tap = tap;
    of_navdata.packet = [this](const std::uint8_t *data, std::size_t size, std::int64_t arrival_ns) {
      return takeNavdata(data, size, arrival_ns);
    };
    video_receiver = std::make_unique<VideoReceiver>(address, std::move(of_video));
    navdata_receiver = std::make_unique<NavdataReceiver>(address, commands, std::move(of_navdata));
  }

  void publish(DecodedFrame &&decoded, std::int64_t arrival_ns)
  {
    const std::lock_guard<std::mutex> lock(mutex);
    LiveFrame frame;
    const VideoStamps::Stamp stamp = stamps.next(decoded.timestamp_ms, arrival_ns);
    counters.clock_jumps = stamps.jumps();
    frame.stamp_ns = stamp.ns;
    if (stamp.is_measured && decoded.status == FrameStatus::ok)
      video_clock.add(frame.stamp_ns, arrival_ns);
    frame.status = decoded.status;
    frame.message = std::move(decoded.message);
    video_rate.add(frame.stamp_ns, arrival_ns);
    if (frame.status == FrameStatus::ok)
      checkStamp(frame, stamp.is_measured);
    frame.picture = std::move(decoded.picture);
    frame.number = decoded.number;
    frame.arrival_ns = arrival_ns;
    if (decoded.unchanged)
      frame.unchanged_since_ns = fresh_stamp_ns;
    else if (decoded.status == FrameStatus::ok)
      fresh_stamp_ns = frame.stamp_ns;
    counters.dropped += newest ? 1 : 0;
    const bool is_worse = newest && newest->status == FrameStatus::ok && frame.status == FrameStatus::corrupt;
    if (!is_worse) // what nobody can decode does not take the place of a picture
      newest = std::move(frame);
    frame_came.notify_one();
  }

  /// A picture of which it is not known when it was taken is of no use to anyone.
  void checkStamp(LiveFrame &frame, bool is_measured) const
  {
    constexpr double kLargestRatio = 1.4; // of the two clocks of one drone; bursts and stalls stay below
    const auto seen = video_rate.rate(), motion = navdata_rate.rate();
    if (seen && motion && *motion > 0 && (*seen > kLargestRatio * *motion || *seen * kLargestRatio < *motion)) {
      frame.status = FrameStatus::doubtful;
      frame.message =
          fmt::format("the video's clock runs {:.2g} times as fast as that of the navdata", *seen / *motion);
    }
    else if (!is_measured) {
      frame.status = FrameStatus::doubtful;
      frame.message = "its stamp is not after that of the frame before";
    }
  }

  /// \return the state bits of a good packet.
  std::optional<std::uint32_t> takeNavdata(const std::uint8_t *data, std::size_t size, std::int64_t arrival_ns)
  {
    Navdata packet;
    const bool is_good = parseNavdata(data, size, packet);
    const std::lock_guard<std::mutex> lock(mutex);
    if (!is_good) {
      ++counters.navdata_refused;
      return std::nullopt;
    }
    if (last_sequence && packet.sequence <= *last_sequence) {
      const bool restart = packet.sequence == 1 || arrival_ns - last_navdata_ns > kSilence_ns;
      if (!restart) {
        ++counters.navdata_late;
        return std::nullopt;
      }
      ++counters.navdata_restarts;
      navdata_time.reset();
      navdata_clock.reset();
      odometry.restart();
    }
    last_sequence = packet.sequence;
    last_navdata_ns = arrival_ns;
    ++counters.navdata_packets;
    if (packet.demo) {
      // Demo packets have no time: then the arrival must do.
      const std::int64_t stamp_ns =
          packet.time ? navdata_time.unwrap(navdataTimeMicroseconds(*packet.time)) * 1000 : arrival_ns;
      navdata_rate.add(stamp_ns, arrival_ns);
      if (!navdata_clock.add(stamp_ns, arrival_ns))
        odometry.restart();
      odometry.add(stamp_ns, packet);
    }
    return packet.state;
  }

  // -- together, with the mutex held

  std::int64_t videoToNavdata(std::int64_t stamp_ns) const
  {
    return navdata_clock.toDrone(video_clock.toHost(stamp_ns) - static_cast<std::int64_t>(address.video_delay_s * 1e9));
  }

  /// A picture that stays while the body moves is no picture of now.
  void checkFrozen(LiveFrame &frame) const
  {
    if (frame.status != FrameStatus::ok || !frame.unchanged_since_ns || counters.navdata_packets == 0)
      return;
    const auto then = odometry.at(videoToNavdata(*frame.unchanged_since_ns));
    if (!frame.body || !then) {
      frame.status = FrameStatus::stale;
      frame.message = "the picture stays, and no navdata say whether the body does";
      return;
    }
    const Vector6d moved = frame.body->wMb.minus(then->wMb);
    if (moved.head<3>().norm() > kFrozen_m || moved.tail<3>().norm() > kFrozen_rad) {
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
  }
};

DroneLink::DroneLink(const ArDroneAddress &address, const LinkTap &tap) : m_state(std::make_unique<State>(address))
{
  m_state->start(tap);
}

DroneLink::~DroneLink() = default;

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

void DroneLink::addMotion(LiveFrame &frame)
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  m_state->addNavdata(frame);
  m_state->last_given_stamp_ns = frame.stamp_ns;
}

std::optional<BodyState> DroneLink::body() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  if (steadyNowNs() - m_state->last_navdata_ns > kSilence_ns)
    return std::nullopt;
  return m_state->odometry.newest();
}

int DroneLink::generation() const { return m_state->video_receiver->generation(); }
LinkCounters DroneLink::counters() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  return m_state->counters;
}
AtChannel &DroneLink::commands() { return m_state->commands; }

namespace
{
// Bits 18, 20, 22, 24 and 28 are always set in AT*REF.
constexpr std::uint32_t kReferenceBase = 0x11540000, kTakeOff = 1u << 9, kEmergency = 1u << 8;
} // namespace

std::string atFloat(float value)
{
  std::int32_t bits = 0;
  std::memcpy(&bits, &value, 4);
  return std::to_string(bits);
}

AtChannel::AtChannel(const std::string &host, std::uint16_t port) : m_socket(Socket::connectUdp(host, port)) {}

void AtChannel::send(const std::string &name, const std::string &arguments)
{
  const std::lock_guard<std::mutex> lock(m_mutex);
  std::string line = fmt::format("AT*{}={}", name, ++m_sequence);
  if (!arguments.empty())
    line += "," + arguments;
  line += "\r";
  m_socket.send(line.data(), line.size());
}

void AtChannel::config(const std::string &key, const std::string &value)
{
  send("CONFIG", fmt::format("\"{}\",\"{}\"", key, value));
}
void AtChannel::acknowledgeConfig() { send("CTRL", "5,0"); }
void AtChannel::resetWatchdog() { send("COMWDG", ""); }
void AtChannel::trimFlat() { send("FTRIM", ""); }

void AtChannel::reference(bool take_off, bool emergency)
{
  send("REF", std::to_string(kReferenceBase | (take_off ? kTakeOff : 0) | (emergency ? kEmergency : 0)));
}

void AtChannel::move(bool progressive, float roll, float pitch, float gaz, float yaw)
{
  send("PCMD",
       fmt::format("{},{},{},{},{}", progressive ? 1 : 0, atFloat(roll), atFloat(pitch), atFloat(gaz), atFloat(yaw)));
}
} // namespace bole
