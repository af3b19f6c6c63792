// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Writes colour pictures into an mp4 file that browsers play.

#include <bole/visp.h>
#include <cstdint>
#include <memory>
#include <string>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

namespace bole
{
/// Encodes H.264 (libx264, or whichever encoder libavcodec has), YUV 4:2:0, index in front, one thread.
///
/// Pictures go to a temporary file that takes its place at finish(); without it no file is left. A picture
/// with an odd number of rows or columns loses the last one, as 4:2:0 needs.
///
/// Errors: vpException naming the file, when it cannot be written or no encoder is there.
///
/// \code
/// VideoWriter video("run/overlay.mp4");
/// video.write(picture, frame.stamp_ns);
/// video.finish();
/// \endcode
class VideoWriter
{
public:
  explicit VideoWriter(const std::string &path);
  ~VideoWriter();
  VideoWriter(const VideoWriter &) = delete;
  VideoWriter &operator=(const VideoWriter &) = delete;

  /// The size of the first picture is that of the video; stamps must rise (one that does not is dropped).
  void write(const vpImage<vpRGBa> &picture, std::int64_t stamp_ns);
  /// Completes the file and puts it in its place; without a picture it leaves no file.
  void finish();
  std::size_t pictures() const;

private:
  struct Libav;
  std::unique_ptr<Libav> m_libav;
};
} // namespace bole
