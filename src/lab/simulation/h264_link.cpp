// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/simulation/h264_link.h"

#include "input/codec.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

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

struct H264Link::State
{
  PictureEncoder encoder;
  PictureDecoder decoder = PictureDecoder::h264();
  double rate_hz;
  std::int64_t count = 0;
  std::size_t bytes = 0;
};

H264Link::H264Link(int width, int height, double rate_hz, double kbps)
{
  if (width % 2 || height % 2 || width < 16 || height < 16)
    throw vpException(vpException::badValue,
                      fmt::format("image size = {}x{}, must be even for H.264 and at least 16", width, height));
  if (!(kbps >= 50 && kbps <= 20000))
    throw vpException(vpException::badValue, fmt::format("h264_kbps = {}, must be 50 to 20000", kbps));
  m_state.reset(new State{PictureEncoder(settingsOf(width, height, rate_hz, kbps)), PictureDecoder::h264(), rate_hz});
}

H264Link::~H264Link() = default;
H264Link::H264Link(H264Link &&) noexcept = default;
H264Link &H264Link::operator=(H264Link &&) noexcept = default;

std::size_t H264Link::lastBytes() const { return m_state->bytes; }

void H264Link::pass(vpImage<unsigned char> &image)
{
  State &s = *m_state;
  const auto width = static_cast<unsigned>(s.encoder.picture().width);
  const auto height = static_cast<unsigned>(s.encoder.picture().height);
  if (image.getWidth() != width || image.getHeight() != height)
    throw vpException(vpException::dimensionError, fmt::format("image size = {}x{}, must be {}x{}", image.getWidth(),
                                                               image.getHeight(), width, height));
  s.encoder.fill(image);
  const AVFrame *received = nullptr;
  s.encoder.encode(std::llround(kTicks * static_cast<double>(s.count++) / s.rate_hz), [&](AVPacket &packet) {
    s.bytes = static_cast<std::size_t>(packet.size);
    received = s.decoder.send(&packet) ? s.decoder.receive() : nullptr;
  });
  if (received == nullptr)
    throw vpException(vpException::fatalError, "H.264 decoding: no picture arrived");
  for (unsigned row = 0; row < height; ++row)
    std::memcpy(image[row], received->data[0] + static_cast<std::ptrdiff_t>(row) * received->linesize[0], width);
}
} // namespace bole
