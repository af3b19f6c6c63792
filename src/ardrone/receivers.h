// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The two threads that drain a drone's sockets.

#include "ardrone/socket.h"

#include "ardrone/drone_link.h"

#include <atomic>
#include <thread>
#include <vector>

namespace bole
{
/// Keeps the video open, decodes all of it and hands on every frame. Starts with the constructor,
/// ends with the destructor; the callbacks run in its thread.
class VideoReceiver
{
public:
  struct Callbacks
  {
    LinkTap tap; ///< may be empty
    std::function<void()> connected;
    std::function<void(DecodedFrame &&, std::int64_t arrival_ns)> frame;
    std::function<void(const DroneVideoDecoder::Counters &)> counted; ///< after what came, frames or not
  };
  VideoReceiver(const ArDroneAddress &address, Callbacks callbacks);
  ~VideoReceiver();
  int generation() const { return m_generation; }

private:
  void run();
  void receiveStream(const Socket &socket, std::vector<std::uint8_t> &buffer);
  void receiveDatagrams(std::vector<std::uint8_t> &buffer);
  void handle(DroneVideoDecoder &video, const std::uint8_t *data, std::size_t size, std::int64_t arrival_ns);
  void begin(DroneVideoDecoder &video);
  DroneVideoDecoder &decoderFor(int generation);
  bool isSilent(std::int64_t since_ns) const;
  void wait(std::chrono::duration<double> pause) const;

  const ArDroneAddress m_address;
  const Callbacks m_callbacks;
  std::atomic<int> m_generation; ///< 0: not known yet
  std::optional<DroneVideoDecoder> m_decoder;
  int m_decoder_generation = 0;
  std::atomic<bool> m_running{true};
  std::thread m_thread;
};

/// Keeps the navdata coming and the drone's communication watchdog content. As VideoReceiver.
class NavdataReceiver
{
public:
  struct Callbacks
  {
    LinkTap tap; ///< may be empty
    /// Takes a packet; returns its state bits where it was a good one.
    std::function<std::optional<std::uint32_t>(const std::uint8_t *data, std::size_t size, std::int64_t arrival_ns)>
        packet;
  };
  NavdataReceiver(const ArDroneAddress &address, AtChannel &commands, Callbacks callbacks);
  ~NavdataReceiver();

private:
  void run();

  const ArDroneAddress m_address;
  AtChannel &m_commands;
  const Callbacks m_callbacks;
  std::atomic<bool> m_running{true};
  std::thread m_thread;
};
} // namespace bole
