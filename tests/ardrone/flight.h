// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A made-up flight with known motion, and an emulator that flies it.

#include "ardrone/drone_link.h"
#include "emulator/emulator.h"
#include "geometry/so3.h"
#include <bole/ardrone_source.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <thread>

namespace bole::test
{
constexpr double kPatience_s = 60; // an upper limit for slow machines, never a measurement

/// Forward at 1 m/s, turning and swaying, 20 Hz, 160x120, gyro at 200 Hz.
class MadeUpFlight : public FrameSource
{
public:
  explicit MadeUpFlight(std::size_t frames, unsigned width = 160, unsigned height = 120)
      : m_frames(frames), m_width(width), m_height(height)
  {
  }

  static Pose pose(double t)
  {
    Pose wMb(expSo3(Eigen::Vector3d(0, 0, 0.2 * t)) * expSo3(Eigen::Vector3d(0.05 * std::sin(t), 0.03, 0)),
             {t, 0.3 * std::sin(t), 1.5 + 0.05 * t});
    return wMb;
  }
  bool next(Frame &frame) override
  {
    if (m_index == m_frames)
      return false;
    frame = {};
    frame.index = m_index;
    frame.stamp_ns = static_cast<std::int64_t>(m_index) * 50'000'000;
    frame.image.resize(m_height, m_width);
    for (unsigned v = 0; v < m_height; ++v)
      for (unsigned u = 0; u < m_width; ++u)
        frame.image[v][u] = static_cast<unsigned char>(
            128 + 80 * std::sin(0.13 * (u - 1.2 * static_cast<double>(m_index))) * std::cos(0.1 * v)); // as it yaws
    const double t = static_cast<double>(m_index) * 0.05;
    frame.wMb_odometry = pose(t);
    for (int i = 1; i <= 10 && m_index > 0; ++i) {
      const double s = t - 0.05 + 0.005 * i;
      frame.gyro.push_back({static_cast<std::int64_t>(std::llround(s * 1e9)),
                            logSo3(pose(s - 1e-3).R.transpose() * pose(s + 1e-3).R) / 2e-3});
    }
    ++m_index;
    return true;
  }
  PinholeCamera camera() const override
  {
    return {120, 120, (m_width - 1) / 2.0, (m_height - 1) / 2.0, static_cast<int>(m_width), static_cast<int>(m_height)};
  }
  Pose bMc() const override { return forwardCamera(); }
  std::string name() const override { return "made-up flight"; }
  bool hasOdometry() const override { return true; }
  bool hasGyro() const override { return true; }

private:
  std::size_t m_frames, m_index = 0;
  unsigned m_width, m_height;
};

inline std::unique_ptr<ArDroneEmulator> emulate(int generation, std::size_t frames,
                                                const ArDroneEmulator::Options &options = {}, bool loop = false)
{
  MadeUpFlight flight(frames);
  SequenceFeedOptions feed;
  feed.generation = generation;
  feed.loop = loop;
  auto emulator = std::make_unique<ArDroneEmulator>(makeSequenceFeed(flight, feed), options);
  emulator->start();
  return emulator;
}

/// Where the emulator is, with a camera that fits its pictures.
inline ArDroneAddress addressOf(const ArDroneEmulator &emulator)
{
  ArDroneAddress address = ArDroneAddress::parse(emulator.address());
  address.camera_path = std::string(BOLE_SOURCE_DIR) + "/tests/ardrone/camera160.yaml";
  return address;
}

/// Calls \p done until it is true; false when patience ends.
inline bool eventually(const std::function<bool()> &done)
{
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatience_s);
  while (!done()) {
    if (std::chrono::steady_clock::now() > end)
      return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}
} // namespace bole::test
