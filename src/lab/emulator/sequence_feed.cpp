// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/text.h"
#include <bole/ardrone_wire.h>

#include "emulator/emulator.h"
#include "support/units.h"
#include <bole/pose.h>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr float kGravity_mg = 1000;
constexpr double kNavdataRate_hz = 200;                  ///< as the drone's full navdata
constexpr std::size_t kMostBytes = std::size_t{2} << 30; ///< of images in memory: a longer sequence is refused

/// A vector in the drone's axes (y right, z down).
Eigen::Vector3d flipped(const Eigen::Vector3d &v) { return {v.x(), -v.y(), -v.z()}; }

/// Roll, pitch, yaw [rad] as the drone counts them: wRb = Rz(-yaw) Ry(-pitch) Rx(roll).
Eigen::Vector3d droneAngles(const Eigen::Matrix3d &wRb)
{
  return {std::atan2(wRb(2, 1), wRb(2, 2)), std::asin(std::clamp(wRb(2, 0), -1.0, 1.0)),
          -std::atan2(wRb(1, 0), wRb(0, 0))};
}

struct StoredFrame
{
  double time_s = 0;
  vpImage<unsigned char> image;
  std::optional<Pose> wMb;
};
struct StoredRate
{
  double time_s;
  Eigen::Vector3d rate;
};

class SequenceFeed : public PacketFeed
{
public:
  SequenceFeed(FrameSource &source, const SequenceFeedOptions &options) : m_options(options)
  {
    if (options.generation != 1 && options.generation != 2)
      throw badValue("generation = {}, must be 1 or 2", options.generation);
    load(source);
    m_duration_s = m_frames.back().time_s - m_frames.front().time_s;
    m_rate_hz = static_cast<double>(m_frames.size() - 1) / m_duration_s;
  }

  int generation() const override { return m_options.generation; }
  double frameRateHz() const override { return m_rate_hz; }

  bool next(FeedPacket &packet) override
  {
    if (!m_options.loop && m_next_frame >= m_frames.size())
      return false;
    const double frame_s = frameTime(m_next_frame);
    const double navdata_s = static_cast<double>(m_next_navdata) / kNavdataRate_hz;
    packet = {};
    if (navdata_s <= frame_s + kVideoDelay_s) {
      packet.kind = FeedPacket::Kind::navdata;
      packet.stamp_ns = packet.sent_ns = nanoseconds(navdata_s);
      packet.navdata = navdataAt(navdata_s);
      ++m_next_navdata;
    }
    else {
      packet.kind = FeedPacket::Kind::picture;
      packet.stamp_ns = nanoseconds(frame_s);
      packet.sent_ns = nanoseconds(frame_s + kVideoDelay_s);
      packet.image = m_frames[frameIndex(m_next_frame)].image;
      ++m_next_frame;
    }
    return true;
  }

private:
  static std::int64_t nanoseconds(double s) { return static_cast<std::int64_t>(std::llround(s * 1e9)); }

  void load(FrameSource &source)
  {
    std::size_t bytes = 0;
    for (Frame frame; source.next(frame);) {
      if (frame.status != FrameStatus::ok && frame.status != FrameStatus::stale)
        continue;
      const double time_s = static_cast<double>(frame.stamp_ns) * 1e-9;
      for (const GyroSample &sample : frame.gyro)
        m_rates.push_back({static_cast<double>(sample.stamp_ns) * 1e-9, sample.rate});
      m_frames.push_back({time_s, frame.image, frame.wMb_odometry});
      bytes += frame.image.getSize();
      if (bytes > kMostBytes)
        throw badValue("{}: more than {} MB of images, must fit; give fewer frames", source.name(), kMostBytes >> 20);
      if (m_frames.size() == m_options.max_frames)
        break;
    }
    if (m_frames.size() < 2)
      throw badValue("{}: {} frames, must be at least 2", source.name(), m_frames.size());
  }

  // Frame k of the flight: there, back, there, ...; the turning frames are shown once.
  std::size_t frameIndex(std::size_t k) const
  {
    const std::size_t last = m_frames.size() - 1, within = k % (2 * last);
    return within <= last ? within : 2 * last - within;
  }
  double frameTime(std::size_t k) const
  {
    const std::size_t last = m_frames.size() - 1, within = k % (2 * last);
    const double there = m_frames[within <= last ? within : 2 * last - within].time_s - m_frames.front().time_s;
    return static_cast<double>(k / (2 * last)) * 2 * m_duration_s + (within <= last ? there : 2 * m_duration_s - there);
  }

  Navdata navdataAt(double flight_s) const
  {
    const double within = std::fmod(flight_s, 2 * m_duration_s);
    const bool back = within > m_duration_s;
    const double direction = back ? -1 : 1;
    const double time_s = m_frames.front().time_s + (back ? 2 * m_duration_s - within : within);
    const auto after = std::upper_bound(m_frames.begin() + 1, m_frames.end() - 1, time_s,
                                        [](double t, const StoredFrame &frame) { return t < frame.time_s; });
    const StoredFrame &a = *(after - 1), &b = *after;
    Navdata navdata;
    navdata.demo = Navdata::Demo{};
    navdata.demo->battery_percent = 80;
    navdata.physical = Navdata::Physical{};
    navdata.physical->acceleration_mg = {0, 0, -kGravity_mg};
    if (!a.wMb || !b.wMb)
      return navdata;
    const double step_s = b.time_s - a.time_s, share = (time_s - a.time_s) / step_s;
    const Eigen::Vector3d turn = b.wMb->minus(*a.wMb).tail<3>();
    const Eigen::Matrix3d wRb = a.wMb->R * expSo3(share * turn);
    const Eigen::Vector3d velocity = direction / step_s * (wRb.transpose() * (b.wMb->t - a.wMb->t));
    const Eigen::Vector3d rate = direction * rateAt(time_s, turn / step_s);
    const double height = a.wMb->t.z() + share * (b.wMb->t.z() - a.wMb->t.z());
    navdata.demo->phi_theta_psi_mdeg = (droneAngles(wRb) / kDegree * 1000).cast<float>();
    navdata.demo->velocity_mm_s = (flipped(velocity) * 1000).cast<float>();
    navdata.demo->altitude_mm = static_cast<std::int32_t>(std::lround(std::max(0.0, height) * 1000));
    navdata.physical->rate_deg_s = (flipped(rate) / kDegree).cast<float>();
    return navdata;
  }

  /// The nearest gyro sample, or \p otherwise where there is none.
  Eigen::Vector3d rateAt(double time_s, const Eigen::Vector3d &otherwise) const
  {
    if (m_rates.empty())
      return otherwise;
    const auto after = std::lower_bound(m_rates.begin(), m_rates.end(), time_s,
                                        [](const StoredRate &sample, double t) { return sample.time_s < t; });
    if (after == m_rates.end())
      return m_rates.back().rate;
    if (after != m_rates.begin() && time_s - (after - 1)->time_s < after->time_s - time_s)
      return (after - 1)->rate;
    return after->rate;
  }

  SequenceFeedOptions m_options;
  std::vector<StoredFrame> m_frames;
  std::vector<StoredRate> m_rates;
  double m_duration_s = 0, m_rate_hz = 0;
  std::size_t m_next_frame = 0, m_next_navdata = 0;
};
} // namespace

std::unique_ptr<PacketFeed> makeSequenceFeed(FrameSource &source, const SequenceFeedOptions &options)
{
  return std::make_unique<SequenceFeed>(source, options);
}
} // namespace bole
