// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What uses libavcodec: decoders of video, single pictures from bytes and to bytes.

#include <bole/visp.h>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

struct AVCodecContext;
struct AVCodecParameters;
struct AVFrame;
struct AVPacket;
struct SwsContext;

namespace bole
{
/// Frees the objects of libav.
struct FreeLibav
{
  void operator()(AVCodecContext *context) const;
  void operator()(AVFrame *frame) const;
  void operator()(AVPacket *packet) const;
  void operator()(SwsContext *scaler) const;
};
template <typename Object> using LibavPtr = std::unique_ptr<Object, FreeLibav>;

/// Keeps libav from writing to the terminal while it lives: its faults become exceptions or statuses.
class QuietLibav
{
public:
  QuietLibav();
  ~QuietLibav();
  QuietLibav(const QuietLibav &) = delete;
  QuietLibav &operator=(const QuietLibav &) = delete;

private:
  int m_level;
};

/// Throws vpException "what: libav's own words" when \p code is an error.
void checkLibav(int code, const std::string &what);

/// Packets in, pictures out, one thread. Not thread-safe.
class PictureDecoder
{
public:
  /// For the stream of a file; errors throw vpException.
  explicit PictureDecoder(const AVCodecParameters &stream);
  /// For H.264 that comes one access unit at a time and must come out at once.
  static PictureDecoder h264();

  /// \param packet nothing at the end of the stream, so that delayed pictures come out. False when the decoder refuses
  /// it.
  bool send(const AVPacket *packet);
  /// The bytes of one access unit; they are copied.
  bool send(const std::uint8_t *data, std::size_t size);
  /// The next picture, valid until the next call; nothing when more packets are needed or the data are broken.
  const AVFrame *receive();
  /// Whether the last receive() failed for another reason than that more packets are needed.
  bool hasFailed() const { return m_has_failed; }
  /// Forgets references: the next picture must be a key frame.
  void flush();
  /// Whether \p picture was put together from damaged data.
  static bool isDamaged(const AVFrame &picture);
  /// Whether its first plane is the 8-bit luma of every pixel and two colour planes of half the size follow.
  static bool isYuv420(const AVFrame &picture);

private:
  explicit PictureDecoder(LibavPtr<AVCodecContext> context);
  LibavPtr<AVCodecContext> m_context;
  LibavPtr<AVFrame> m_frame;
  LibavPtr<AVPacket> m_packet;
  bool m_has_failed = false;
};

/// The grey levels of a PNG, JPEG, BMP, TIFF or PNM, 8 bits of them, colours by ITU-R BT.601, transparency ignored.
/// False for what cannot be decoded. Never throws.
bool decodeGrey(const std::vector<unsigned char> &bytes, vpImage<unsigned char> &grey);

/// Throw vpException where libavcodec cannot.
std::string encodePng(const vpImage<unsigned char> &grey);
std::string encodeJpeg(const vpImage<vpRGBa> &picture);
} // namespace bole
