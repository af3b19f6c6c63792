// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Grey pictures with their times out of a video file (libavformat, libavcodec).

#include <atomic>
#include <bole/visp.h>
#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <visp3/core/vpImage.h>

struct AVFrame;

namespace bole
{
/// A picture, or the place of one that could not be decoded or is not in the file (then the image is empty).
struct Picture
{
  std::int64_t stamp_ns = 0; ///< since the first picture
  bool is_damaged = false;
  bool is_missing = false; ///< the container counts it and the file ends before it
  std::string message;
  vpImage<unsigned char> image;
  std::int64_t clock = 0; ///< the time that the stream itself has for it, in a unit of its own
};

/// What ends a read from an address that would wait for ever: stop it from any thread.
struct ReadLimit
{
  std::atomic<bool> is_stopped{false};
  std::atomic<std::int64_t> until_ns{0}; ///< of the steady clock; set before each read
};

/// Decodes the best video stream of a file, in the order of presentation, one thread.
///
/// Every packet of the stream must end in a picture: one that does not (lost reference, damaged data) is reported in
/// its place as damaged, so that nothing is skipped silently. Pictures the decoder had to conceal are damaged too. A
/// file that was cut off goes on with missing pictures up to the count of its container (AVI, MP4; Matroska has none).
/// A rotation by quarter turns that the file asks for is applied.
class VideoFile
{
public:
  /// Throws vpException when the file is no video that can be decoded.
  explicit VideoFile(const std::string &path);
  /// The same of an address (rtsp://, http://, file://): throws vpException where it stays silent, too.
  VideoFile(const std::string &address, std::shared_ptr<ReadLimit> limit);
  ~VideoFile();
  VideoFile(const VideoFile &) = delete;
  VideoFile &operator=(const VideoFile &) = delete;

  /// False at the end.
  bool next(Picture &picture);
  /// The first picture that is whole, to be called before next(), which gives it and those before it all the same.
  /// Throws vpException where none is.
  const Picture &firstWhole();
  /// By the file's own count, 0 when it does not say.
  std::size_t frames() const;
  /// By the file's own word [ns], 0 when it does not say.
  std::int64_t duration_ns() const;
  /// Whether it comes from an address and does not say how long it is, in time nor in bytes.
  bool isLive() const;
  /// Width of a pixel over its height: 1 but of anamorphic video.
  double pixelAspect() const;
  const std::shared_ptr<ReadLimit> &limit() const { return m_limit; }

private:
  struct Libav;

  void open(const std::string &url);
  void allowReading(double seconds) const;
  void decodeMore();
  void take(const AVFrame &frame);
  void reportLost(std::int64_t before);
  void reportMissing();
  void emit(Picture picture);
  std::int64_t stampOf(std::int64_t pts);

  std::string m_path, m_name;         ///< to be opened; to be shown
  std::shared_ptr<ReadLimit> m_limit; ///< of an address
  std::unique_ptr<Libav> m_libav;
  std::deque<Picture> m_ready;
  std::set<std::int64_t> m_pending; ///< times of packets that have not become a picture yet
  std::int64_t m_first_pts = 0;
  bool m_has_first = false;
  std::int64_t m_last_stamp_ns = -1;
  bool m_is_at_end = false;
  std::size_t m_counted = 0; ///< pictures handed out and packets that are not to be shown
};
} // namespace bole
