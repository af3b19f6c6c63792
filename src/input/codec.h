// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One door to libavcodec: every picture of the project is decoded and encoded through it.

#include <bole/visp.h>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <visp3/core/vpImage.h>

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

/// Pictures in, packets of H.264 (YUV 4:2:0) out, one thread. Not thread-safe.
class PictureEncoder
{
public:
  struct Settings
  {
    int width = 0, height = 0;        ///< [px], even
    int ticks_per_second = 1000;      ///< unit of the time stamps
    double rate_hz = 0;               ///< pictures a second for the rate control; 0: not known
    double bit_rate = 0;              ///< [bit/s]; 0: constant quality \p quality
    bool is_bit_rate_limited = false; ///< no second above bit_rate
    int quality = 21;                 ///< x264's CRF: lower is better
    int key_interval = 50;            ///< pictures from a key frame to the next
    bool is_live = false;             ///< baseline profile, each picture comes out at once: as a drone encodes
    bool has_global_header = false;   ///< for containers that keep the headers apart
    bool may_be_mpeg4 = false;        ///< where libavcodec has no H.264 encoder
    std::string x264_parameters;      ///< more for libx264
  };
  using Sink = std::function<void(AVPacket &)>;

  /// Throws vpException when libavcodec has no encoder or it cannot be opened.
  explicit PictureEncoder(const Settings &settings);

  /// Picture to fill before encode().
  AVFrame &picture();
  /// Fills picture() with grey levels; what is beyond the image repeats its last column and row.
  void fill(const vpImage<unsigned char> &image);
  /// Encodes picture(); \p stamp in ticks, rising. Packets that are ready go to \p sink.
  void encode(std::int64_t stamp, const Sink &sink, bool is_key_forced = false);
  /// Gives the packets that are still inside.
  void finish(const Sink &sink);
  const AVCodecContext &context() const { return *m_context; }

private:
  void send(const AVFrame *frame, const Sink &sink);
  LibavPtr<AVCodecContext> m_context;
  LibavPtr<AVFrame> m_frame;
  LibavPtr<AVPacket> m_packet;
};
} // namespace bole
