// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a drone's video link does to a picture: H.264 at a low bit rate.

#include "support/h264.h"

namespace bole
{
/// Encodes each picture as the drone does (a key frame every 30) and decodes it again.
class H264Link
{
public:
  /// \param width, height even [px]; \param kbps 50 to 20000. Throws vpException where libavcodec has no H.264 encoder.
  H264Link(int width, int height, double rate_hz, double kbps);

  /// Replaces \p image by what arrives.
  void pass(vpImage<unsigned char> &image);
  /// Size of the last encoded picture.
  std::size_t lastBytes() const { return m_bytes; }

private:
  VideoPacketEncoder m_encoder;
  VideoPacketDecoder m_decoder;
  std::size_t m_bytes = 0;
};
} // namespace bole
