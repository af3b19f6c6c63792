// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Cameras that are watched as they film: a stream by its address, or a camera of this machine.

#include "input/recorded_source.h"
#include "input/video_file.h"

#include <memory>

namespace bole
{
/// Frames of a camera behind an address (rtsp://, http:// and what else libavformat opens; file:// reads a pipe) or at
/// this machine (/dev/video0, by ViSP's V4L2 grabber), newest first served: a thread of its own takes every picture,
/// and next() gives the newest that it has not given yet.
///
/// Stamps are those of the stream, from the first picture on; pictures of a stream that has none (multipart JPEG) are
/// stamped as they come. A connection that breaks is made again; its stamps go on by the clock of this machine. While
/// nothing comes there is a `missing` frame every half second, and after Options::give_up_s next() ends.
///
/// One thread calls next(); stop() may be called from any.
///
/// Errors: vpException naming the address when nothing answers, what answers is no video, or the camera file is of
/// another size.
class LiveVideoSource : public RecordedSource
{
public:
  struct Counters
  {
    std::size_t pictures = 0;    ///< that came
    std::size_t dropped = 0;     ///< that a newer one came before next() asked for, or of a time that is over
    std::size_t connections = 0; ///< that were made
  };

  /// Whether \p address is one for this source (not ardrone://).
  static bool accepts(const std::string &address);

  /// \p give_up_s: silence that ends the stream [s], above 0. \p file: of \p address, and live, where that was opened
  /// already.
  explicit LiveVideoSource(const std::string &address, const SourceOptions &options = {}, double give_up_s = 10,
                           std::unique_ptr<VideoFile> file = nullptr);
  ~LiveVideoSource() override;

  bool next(Frame &frame) override;
  bool isCompressed() const override { return true; }
  Counters counters() const;
  void stop() noexcept;

private:
  struct State;
  std::unique_ptr<State> m_state;
};

/// \p address opened: live where it does not tell how long it is, else a recording that is read as any other.
/// \p give_up_s: as above.
std::unique_ptr<FrameSource> openStream(const std::string &address, const SourceOptions &options,
                                        double give_up_s = 10);
} // namespace bole
