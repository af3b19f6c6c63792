// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/h264_link.h"

#include "support/text.h"

namespace bole
{
namespace
{
VideoPacketEncoder::Settings settingsOf(int width, int height, double rate_hz, double kbps)
{
  if (width % 2 || height % 2 || width < 16 || height < 16)
    throw badValue("image size = {}x{}, must be even for H.264 and at least 16", width, height);
  if (!(kbps >= 50 && kbps <= 20000))
    throw badValue("h264_kbps = {}, must be 50 to 20000", kbps);
  return {width, height, rate_hz, 1000 * kbps, true, 30, "log=-1:threads=1"};
}
} // namespace

H264Link::H264Link(int width, int height, double rate_hz, double kbps)
    : m_encoder(settingsOf(width, height, rate_hz, kbps))
{
}

void H264Link::pass(vpImage<unsigned char> &image)
{
  if (static_cast<int>(image.getWidth()) != m_encoder.width() ||
      static_cast<int>(image.getHeight()) != m_encoder.height())
    throw badValue("image size = {}x{}, must be {}x{}", image.getWidth(), image.getHeight(), m_encoder.width(),
                   m_encoder.height());
  const VideoPacketEncoder::Packet packet = m_encoder.encode(image);
  m_bytes = packet.bytes.size();
  m_decoder.decode(packet, image);
}
} // namespace bole
