// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What folders, numbered images and video files have in common as sources.

#include "input/frame_builder.h"

#include <fmt/format.h>
#include <memory>
#include <string>
#include <vector>

namespace bole
{
/// Answers for its camera and sensors; a source adds where its images come from.
class RecordedSource : public FrameSource
{
public:
  PinholeCamera camera() const override { return m_builder->camera(); }
  Pose bMc() const override { return m_builder->bMc(); }
  std::string name() const override { return m_name; }
  bool hasOdometry() const override { return !m_builder->recording().odometry.empty(); }
  bool hasGyro() const override { return !m_builder->recording().gyro.empty(); }
  bool isCameraKnown() const override { return m_note.empty(); } // the note tells of a guess
  std::string note() const override { return m_note; }
  /// The camera as it films, with its lens and before it is shrunk.
  const CameraModel &lens() const { return m_builder->lens(); }
  /// Name of the file of frame \p index; of a video that which `ffmpeg -i VIDEO %06d.png` would give it.
  virtual std::string pictureName(std::size_t index) const { return fmt::format("{:06}.png", index + 1); }

protected:
  std::string m_name, m_note;
  std::unique_ptr<FrameBuilder> m_builder; ///< set by the constructor of the source
};

/// An image file and when it was taken.
struct ImageRow
{
  std::int64_t stamp_ns = 0;
  std::string path;
};

/// The first of \p rows that can be read, in \p file; nullptr where none can, and \p file tells why the first cannot.
const ImageRow *firstReadable(const std::vector<ImageRow> &rows, ImageFile &file);

/// Recorded as one file an image: every row is a frame.
class ImageFilesSource : public RecordedSource
{
public:
  bool next(Frame &frame) override;
  std::size_t size() const override { return m_rows.size(); }
  std::string pictureName(std::size_t index) const override;

protected:
  std::vector<ImageRow> m_rows;

private:
  std::size_t m_at = 0;
};
} // namespace bole
