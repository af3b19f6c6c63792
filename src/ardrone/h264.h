// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Pictures of a drone in YCbCr, and the decoder of the AR.Drone 2's video.

#include "input/codec.h"

#include <cstdint>
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
/// Whatever libavcodec says about damage (an error, a missing reference, concealed blocks) makes the picture `damaged`:
/// it conceals by copying, which for a tracker is worse than nothing. Not thread-safe.
class H264Decoder
{
public:
  enum class Result
  {
    picture,
    damaged,
    nothing
  };

  /// \param picture written for `picture` and, with what could be decoded, for `damaged`.
  /// \param width, height [px] part of the coded picture that is shown; 0 for all of it.
  Result decode(const std::vector<std::uint8_t> &access_unit, int width, int height, YuvPicture &picture);
  /// Forgets references: the next picture must be a key frame.
  void flush() { m_decoder.flush(); }
  const std::string &message() const { return m_message; } ///< why the last picture was not whole

private:
  PictureDecoder m_decoder = PictureDecoder::h264();
  std::string m_message;
};
} // namespace bole
