// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/emulator/h264_encoder.h"
#include "geometry/failure.h"

#include <cmath>
#include <fmt/format.h>

extern "C" {
#include <libavcodec/avcodec.h>
}

namespace bole
{
namespace
{
/// Size in bytes, start code included, of the NAL unit at \p from; \p type is its type.
std::size_t nalSize(const std::vector<std::uint8_t> &bytes, std::size_t from, int &type)
{
  const auto startsAt = [&](std::size_t i) {
    return i + 3 < bytes.size() && bytes[i] == 0 && bytes[i + 1] == 0 &&
           (bytes[i + 2] == 1 || (bytes[i + 2] == 0 && bytes[i + 3] == 1));
  };
  if (!startsAt(from))
    return 0;
  const std::size_t payload = from + (bytes[from + 2] == 1 ? 3 : 4);
  if (payload >= bytes.size())
    return 0;
  type = bytes[payload] & 0x1f;
  std::size_t end = payload + 1;
  while (end < bytes.size() && !startsAt(end))
    ++end;
  return end - from;
}

PictureEncoder::Settings settingsOf(int width, int height, double rate_hz, double bit_rate, int key_interval)
{
  PictureEncoder::Settings settings;
  settings.width = (width + 15) / 16 * 16;
  settings.height = (height + 15) / 16 * 16;
  settings.rate_hz = rate_hz;
  settings.bit_rate = bit_rate;
  settings.key_interval = key_interval;
  settings.is_live = true;
  settings.x264_parameters = fmt::format("keyint={0}:min-keyint={0}:scenecut=0", key_interval);
  return settings;
}
} // namespace

H264Encoder::H264Encoder(int width, int height, double rate_hz, double bit_rate, int key_interval)
    : m_width(width),
      m_height(height),
      m_rate_hz(rate_hz),
      m_encoder(settingsOf(width, height, rate_hz, bit_rate, key_interval))
{
}

H264Encoder::Packet H264Encoder::encode(const vpImage<unsigned char> &image, bool force_key)
{
  if (static_cast<int>(image.getWidth()) != m_width || static_cast<int>(image.getHeight()) != m_height)
    throw dimensionError("image size = {}x{}, must be {}x{} as the first", image.getWidth(), image.getHeight(), m_width,
                         m_height);
  m_encoder.fill(image);
  Packet packet;
  const auto take = [&packet](const AVPacket &encoded) {
    packet.bytes.assign(encoded.data, encoded.data + encoded.size);
    packet.is_key = (encoded.flags & AV_PKT_FLAG_KEY) != 0;
  };
  m_encoder.encode(std::llround(1000.0 * static_cast<double>(++m_count) / m_rate_hz), take, force_key);
  if (packet.bytes.empty())
    throw fatalError("libavcodec did not encode the frame");
  int type = 0;
  const std::size_t first = packet.is_key ? nalSize(packet.bytes, 0, type) : 0;
  if (first > 0 && type == 7) {
    packet.sps_size = static_cast<std::uint8_t>(first);
    const std::size_t second = nalSize(packet.bytes, first, type);
    if (type == 8)
      packet.pps_size = static_cast<std::uint8_t>(second);
  }
  return packet;
}

std::vector<std::uint8_t> H264Encoder::paveFrame(const Packet &packet, PaveHeader header) const
{
  header.payload_size = header.advertised_size = static_cast<std::uint32_t>(packet.bytes.size());
  header.coded_width = static_cast<std::uint16_t>(m_encoder.context().width);
  header.coded_height = static_cast<std::uint16_t>(m_encoder.context().height);
  header.display_width = static_cast<std::uint16_t>(m_width);
  header.display_height = static_cast<std::uint16_t>(m_height);
  header.frame_type = packet.is_key ? PaveFrameType::idr : PaveFrameType::p;
  header.header1_size = packet.sps_size;
  header.header2_size = packet.pps_size;
  std::vector<std::uint8_t> bytes = encodePaveHeader(header);
  bytes.insert(bytes.end(), packet.bytes.begin(), packet.bytes.end());
  return bytes;
}
} // namespace bole
