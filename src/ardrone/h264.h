// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// H.264 through libavcodec: the decoder of the AR.Drone 2's video and the emulator's encoder.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

namespace bole
{
/// A decoded picture in the planes of YCbCr 4:2:0, colour planes at half the size.
struct YuvPicture
{
  int width = 0, height = 0;           ///< [px]
  std::vector<std::uint8_t> y, cb, cr; ///< rows without padding; colour rows of (width + 1) / 2
  std::uint32_t number = 0;            ///< frame number as the drone counts

  bool empty() const { return y.empty(); }
  void toGrey(vpImage<unsigned char> &image) const;
  void toColour(vpImage<vpRGBa> &image) const;
};

/// Decodes one access unit at a time, without delay.
///
/// Whatever libavcodec says about damage (an error, a missing reference, concealed blocks) makes
/// the picture `damaged`: it conceals by copying, which for a tracker is worse than nothing. Not
/// thread-safe.
class H264Decoder
{
public:
  enum class Result
  {
    picture,
    damaged,
    nothing
  };

  H264Decoder();
  ~H264Decoder();
  H264Decoder(const H264Decoder &) = delete;
  H264Decoder &operator=(const H264Decoder &) = delete;

  /// \param picture written for `picture` and, with what could be decoded, for `damaged`.
  /// \param width, height [px] part of the coded picture that is shown; 0 for all of it.
  Result decode(const std::vector<std::uint8_t> &access_unit, int width, int height, YuvPicture &picture);
  /// Forgets references: the next picture must be a key frame.
  void flush();
  const std::string &message() const { return m_message; } ///< why the last picture was not whole

private:
  struct State;
  std::unique_ptr<State> m_state;
  std::string m_message;
};

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
  ~H264Encoder();
  H264Encoder(const H264Encoder &) = delete;
  H264Encoder &operator=(const H264Encoder &) = delete;

  Packet encode(const vpImage<unsigned char> &image, bool force_key = false);
  int codedWidth() const;  ///< [px], a multiple of 16
  int codedHeight() const; ///< [px], a multiple of 16

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
