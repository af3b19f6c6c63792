// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/receivers.h"

#include "input/steady_clock.h"

#include <array>

namespace bole
{
namespace
{
constexpr std::array<std::uint8_t, 4> kWakeUp = {1, 0, 0, 0};
constexpr std::size_t kLargestRead = 1 << 16;
constexpr Milliseconds kPoll{50};
// With the pause and half a second to a key frame: within a second.
constexpr Milliseconds kConnect{250};
constexpr double kSilence_s = 0.8;                  // after which the video is opened anew
constexpr double kRetry_s = 0.1;                    // between two attempts
constexpr double kLongestPause_s = 1;               // between two connections that the drone closes at once
constexpr std::int64_t kKeepAlive_ns = 250'000'000; // the drone's watchdog bites after 2 s
constexpr std::int64_t kOneSecond_ns = 1'000'000'000;
constexpr int kMostDatagrams = 1000;          // a second: the drone sends 15, an emulator at its fastest 600
constexpr std::size_t kLargestNavdata = 8192; // bytes
constexpr std::int64_t kWakeAgain_ns = 500'000'000;

/// Whether the drone, by the \p bits of its state, sends less than all its navdata, which have the gyro and a time.
bool asksForConfig(std::uint32_t bits)
{
  constexpr auto kAsks =
      static_cast<std::uint32_t>(DroneState::bootstrap) | static_cast<std::uint32_t>(DroneState::demo_mode);
  return (bits & kAsks) != 0;
}

/// Whether the drone can have sent so many datagrams: what is more is a flood.
class DatagramCount
{
public:
  bool isUsual(std::int64_t now_ns)
  {
    if (now_ns - m_second_ns > kOneSecond_ns) {
      m_second_ns = now_ns;
      m_count = 0;
    }
    return ++m_count <= kMostDatagrams;
  }

private:
  std::int64_t m_second_ns = 0;
  int m_count = 0;
};
} // namespace

VideoReceiver::VideoReceiver(const ArDroneAddress &address, Callbacks callbacks)
    : m_address(address),
      m_callbacks(std::move(callbacks)),
      m_generation(address.generation),
      m_thread([this] { run(); })
{
}

VideoReceiver::~VideoReceiver()
{
  m_running = false;
  m_thread.join();
}

void VideoReceiver::run()
{
  std::vector<std::uint8_t> buffer(kLargestRead);
  RetryPause pause(kRetry_s, kLongestPause_s);
  while (m_running) {
    const int wanted = m_generation;
    if (wanted != 1) {
      if (const Socket socket = Socket::connectTcp(m_address.host, m_address.video_port, kConnect); socket.valid()) {
        m_generation = 2;
        const std::int64_t connected_ns = steadyNowNs();
        receiveStream(socket, buffer);
        if (steadyNowNs() - connected_ns > kOneSecond_ns)
          pause.reset();
        wait(pause.next());
        continue;
      }
    }
    if (wanted != 2)
      receiveDatagrams(buffer);
    wait(std::chrono::duration<double>(kRetry_s));
  }
}

void VideoReceiver::wait(std::chrono::duration<double> pause) const
{
  for (std::chrono::duration<double> left = pause; m_running && left.count() > 0; left -= kPoll)
    std::this_thread::sleep_for(std::min<std::chrono::duration<double>>(left, kPoll));
}

void VideoReceiver::begin(DroneVideoDecoder &video)
{
  video.restart();
  if (m_callbacks.tap)
    m_callbacks.tap(LinkChannel::video_connected, steadyNowNs(), nullptr, 0);
  m_callbacks.connected();
}

bool VideoReceiver::isSilent(std::int64_t since_ns) const
{
  return static_cast<double>(steadyNowNs() - since_ns) * 1e-9 > kSilence_s;
}

DroneVideoDecoder &VideoReceiver::decoderFor(int generation)
{
  if (!m_decoder || m_decoder_generation != generation) {
    m_decoder.emplace(generation);
    m_decoder_generation = generation;
  }
  return *m_decoder;
}

void VideoReceiver::receiveStream(const Socket &socket, std::vector<std::uint8_t> &buffer)
{
  DroneVideoDecoder &video = decoderFor(2);
  begin(video);
  std::int64_t last_data_ns = steadyNowNs();
  while (m_running && !isSilent(last_data_ns)) {
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

void VideoReceiver::receiveDatagrams(std::vector<std::uint8_t> &buffer)
{
  const Socket socket = Socket::connectUdp(m_address.host, m_address.video_port);
  bool has_begun = false;
  std::int64_t last_data_ns = steadyNowNs(), last_wake_ns = 0;
  DatagramCount count;
  while (m_running && socket.valid() && !isSilent(last_data_ns)) {
    const std::int64_t now_ns = steadyNowNs();
    if (now_ns - last_wake_ns > kWakeAgain_ns) {
      socket.send(kWakeUp.data(), kWakeUp.size());
      last_wake_ns = now_ns;
    }
    std::size_t size = 0;
    const auto read = socket.receive(buffer.data(), buffer.size(), size, kPoll);
    if (read == Socket::Read::closed && !has_begun && m_generation == 0)
      return; // nobody listens: perhaps it is a drone 2 after all
    if (read != Socket::Read::data)
      continue;
    last_data_ns = steadyNowNs();
    m_generation = 1;
    DroneVideoDecoder &video = decoderFor(1);
    if (!count.isUsual(last_data_ns)) { // a flood: the socket's buffer drops the rest
      video.refuse();
      continue;
    }
    if (!has_begun)
      begin(video);
    has_begun = true;
    handle(video, buffer.data(), size, last_data_ns);
  }
}

void VideoReceiver::handle(DroneVideoDecoder &video, const std::uint8_t *data, std::size_t size,
                           std::int64_t arrival_ns)
{
  if (m_callbacks.tap)
    m_callbacks.tap(LinkChannel::video, arrival_ns, data, size);
  for (DecodedFrame &decoded : video.decode(data, size))
    m_callbacks.frame(std::move(decoded), arrival_ns);
  m_callbacks.counted(video.counters());
}

NavdataReceiver::NavdataReceiver(const ArDroneAddress &address, AtChannel &commands, Callbacks callbacks)
    : m_address(address), m_commands(commands), m_callbacks(std::move(callbacks)), m_thread([this] { run(); })
{
}

NavdataReceiver::~NavdataReceiver()
{
  m_running = false;
  m_thread.join();
}

void NavdataReceiver::run()
{
  std::vector<std::uint8_t> buffer(kLargestRead);
  const Socket socket = Socket::connectUdp(m_address.host, m_address.navdata_port);
  std::int64_t last_wake_ns = 0, last_alive_ns = 0, last_config_ns = 0, last_data_ns = 0;
  DatagramCount count;
  while (m_running) {
    const std::int64_t now_ns = steadyNowNs();
    if (now_ns - last_data_ns > kWakeAgain_ns && now_ns - last_wake_ns > kWakeAgain_ns) {
      socket.send(kWakeUp.data(), kWakeUp.size());
      last_wake_ns = now_ns;
    }
    if (now_ns - last_alive_ns > kKeepAlive_ns) {
      m_commands.resetWatchdog();
      last_alive_ns = now_ns;
    }
    std::size_t size = 0;
    const auto read = socket.receive(buffer.data(), buffer.size(), size, kPoll);
    if (read == Socket::Read::closed)
      std::this_thread::sleep_for(kPoll); // the drone is not up yet
    if (read != Socket::Read::data)
      continue;
    last_data_ns = steadyNowNs();
    if (!count.isUsual(last_data_ns) || size > kLargestNavdata)
      continue;
    if (m_callbacks.tap)
      m_callbacks.tap(LinkChannel::navdata, last_data_ns, buffer.data(), size);
    const auto state = m_callbacks.packet(buffer.data(), size, last_data_ns);
    if (state && last_data_ns - last_config_ns > kWakeAgain_ns && asksForConfig(*state)) {
      m_commands.config("general:navdata_demo", "FALSE");
      m_commands.acknowledgeConfig();
      last_config_ns = last_data_ns;
    }
  }
}
} // namespace bole
