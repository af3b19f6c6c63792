// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Video files.

#include "input/recorded_source.h"

namespace bole
{
class VideoFile;

/// Reads a video file (any container and codec of libavformat and libavcodec) frame by frame.
///
/// Stamps are the container's, counted from the first frame. A packet that does not become a
/// picture, or becomes one that the decoder had to conceal, is a frame with the status `corrupt`;
/// the picture before again is `stale`; another size is `resized`; those that the container counts
/// beyond the end of a file that was cut off are `missing` (AVI, MP4; Matroska does not count).
/// vpVideoReader is not used: it gives no stamps and repeats the last picture when decoding fails.
///
/// Errors: vpException naming the file when it is no video, the camera is of another size, or the
/// odometry is over before the video begins or begins after it is over.
class VideoSource : public RecordedSource
{
public:
  explicit VideoSource(const std::string &path, const SourceOptions &options = {});
  /// With what was opened already. \p file: that of \p path.
  VideoSource(const std::string &path, const SourceOptions &options, std::unique_ptr<VideoFile> file);
  ~VideoSource() override;

  bool next(Frame &frame) override;
  std::size_t size() const override;
  bool isCompressed() const override { return true; }

private:
  std::unique_ptr<VideoFile> m_file;
};
} // namespace bole
