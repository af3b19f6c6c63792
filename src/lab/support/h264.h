// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// H.264 as a drone sends it, by libavcodec: baseline profile, each picture comes out at once. Same pictures, same
/// bytes: one thread.
#include <bole/visp.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// Pictures in, packets out.
class VideoPacketEncoder
{
public:
  struct Settings
  {
    int width = 0, height = 0;        ///< [px], even
    double rate_hz = 30;              ///< pictures a second
    double bit_rate = 1e6;            ///< [bit/s]
    bool is_bit_rate_limited = false; ///< no second above bit_rate
    int key_interval = 30;            ///< pictures from a key frame to the next
    std::string x264_parameters;      ///< more for libx264
  };
  struct Packet
  {
    std::vector<std::uint8_t> bytes;
    bool is_key = false;
  };

  /// Throws vpException where libavcodec has no H.264 encoder or it cannot be opened.
  explicit VideoPacketEncoder(const Settings &settings);
  ~VideoPacketEncoder();

  int width() const;
  int height() const;
  /// What is beyond \p image repeats its last column and row.
  Packet encode(const vpImage<unsigned char> &image, bool is_key_forced = false);

private:
  struct Libav;
  std::unique_ptr<Libav> m_libav;
};

/// Packets in, pictures out.
class VideoPacketDecoder
{
public:
  VideoPacketDecoder();
  ~VideoPacketDecoder();

  /// The grey levels of the picture in \p packet fill \p image, of the same size.
  void decode(const VideoPacketEncoder::Packet &packet, vpImage<unsigned char> &image);

private:
  struct Libav;
  std::unique_ptr<Libav> m_libav;
};

/// What a drone's video link does to a picture: H.264 at a low bit rate.
///
/// Encodes each picture as the drone does (a key frame every 30) and decodes it again.
class H264Link
{
public:
  /// \param width, height even [px]; \param kbps 50 to 20000. Throws vpException where libavcodec has no H.264 encoder.
  H264Link(int width, int height, double rate_hz, double kbps);

  /// Replaces \p image, which is of the link's size, by what arrives.
  void pass(vpImage<unsigned char> &image);
  /// Size of the last encoded picture.
  std::size_t lastBytes() const { return m_bytes; }

private:
  VideoPacketEncoder m_encoder;
  VideoPacketDecoder m_decoder;
  std::size_t m_bytes = 0;
};
} // namespace bole
