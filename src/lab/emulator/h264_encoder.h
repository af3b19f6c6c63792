// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The encoder of an emulated AR.Drone 2.

#include "ardrone/pave.h"
#include "input/codec.h"

#include <bole/visp.h>
#include <cstdint>
#include <vector>

namespace bole
{
/// Encodes as an AR.Drone 2 does: baseline profile, no delay, a key frame every \p key_interval
/// frames with SPS and PPS in front. Throws vpException where libavcodec has no H.264 encoder.
class H264Encoder
{
public:
  struct Packet
  {
    std::vector<std::uint8_t> bytes;
    bool is_key = false;
    std::uint8_t sps_size = 0, pps_size = 0; ///< [byte], with start codes; 0 but for key frames
  };

  /// \param bit_rate [bit/s]
  H264Encoder(int width, int height, double rate_hz, double bit_rate, int key_interval = 15);

  Packet encode(const vpImage<unsigned char> &image, bool force_key = false);
  /// \p packet behind its header, \p header, of which number, time and place in the stream are given.
  std::vector<std::uint8_t> paveFrame(const Packet &packet, PaveHeader header) const;

private:
  int m_width, m_height;
  double m_rate_hz;
  std::int64_t m_count = 0;
  PictureEncoder m_encoder;
};
} // namespace bole
