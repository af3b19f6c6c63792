// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/simulation/h264_link.h"

#include "geometry/failure.h"
#include <cmath>
#include <cstring>

extern "C" {
#include <libavcodec/packet.h>
#include <libavutil/frame.h>
}

namespace bole
{
namespace
{
constexpr int kTicks = 1'000'000; // a second

PictureEncoder::Settings settingsOf(int width, int height, double rate_hz, double kbps)
{
  if (width % 2 || height % 2 || width < 16 || height < 16)
    throw badValue("image size = {}x{}, must be even for H.264 and at least 16", width, height);
  if (!(kbps >= 50 && kbps <= 20000))
    throw badValue("h264_kbps = {}, must be 50 to 20000", kbps);
  PictureEncoder::Settings settings;
  settings.width = width;
  settings.height = height;
  settings.ticks_per_second = kTicks;
  settings.rate_hz = rate_hz;
  settings.bit_rate = 1000 * kbps;
  settings.is_bit_rate_limited = true;
  settings.key_interval = 30;
  settings.is_live = true;
  settings.x264_parameters = "log=-1:threads=1";
  return settings;
}
} // namespace

H264Link::H264Link(int width, int height, double rate_hz, double kbps)
    : m_encoder(settingsOf(width, height, rate_hz, kbps)), m_rate_hz(rate_hz)
{
}

void H264Link::pass(vpImage<unsigned char> &image)
{
  const auto width = static_cast<unsigned>(m_encoder.picture().width);
  const auto height = static_cast<unsigned>(m_encoder.picture().height);
  if (image.getWidth() != width || image.getHeight() != height)
    throw dimensionError("image size = {}x{}, must be {}x{}", image.getWidth(), image.getHeight(), width, height);
  m_encoder.fill(image);
  const AVFrame *received = nullptr;
  m_encoder.encode(std::llround(kTicks * static_cast<double>(m_count++) / m_rate_hz), [&](AVPacket &packet) {
    m_bytes = static_cast<std::size_t>(packet.size);
    received = m_decoder.send(&packet) ? m_decoder.receive() : nullptr;
  });
  if (received == nullptr)
    throw fatalError("H.264 decoding: no picture arrived");
  for (unsigned row = 0; row < height; ++row)
    std::memcpy(image[row], received->data[0] + static_cast<std::ptrdiff_t>(row) * received->linesize[0], width);
}
} // namespace bole
