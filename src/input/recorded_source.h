// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Recorded flights: EuRoC / ASL folders, numbered images and video files.

#include "input/frame_builder.h"

#include <fmt/format.h>
#include <memory>
#include <string>
#include <vector>

namespace bole
{
class VideoFile;

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

/// Reads `mav0/cam0` and, where they are there, `imu0` (gyro), `odom0` (the pose filter on board) and
/// `state_groundtruth_estimate0` (truth). The folder may be given as the sequence or as its `mav0`.
///
/// Every row of cam0/data.csv becomes one frame: an image that is absent is `missing`, one that cannot be decoded
/// `corrupt`, one of another size `resized`, one with the pixels of the frame before `stale`. The pose filter's pose is
/// that at the stamp of the frame (interpolate()), absent outside its range; gyro samples are those of (previous frame,
/// this frame]. A `sensor.yaml` beside imu0, odom0 or the truth may give its `T_BS`; angular rates and poses are
/// carried to the body by it.
///
/// Errors: vpException with file:line for a missing or empty folder, rows that are not what they must be, stamps that
/// go back, a camera file with a fault, or images of another size than the camera's.
class AslSource : public ImageFilesSource
{
public:
  explicit AslSource(const std::string &folder, const SourceOptions &options = {});

  /// Stamps of all frames [ns]; the whole odometry and the whole truth, each may be empty.
  std::vector<std::int64_t> stamps() const;
  const Trajectory &odometry() const;
  const Trajectory &truth() const;

  /// Whether \p path looks like such a folder.
  static bool accepts(const std::string &path);
};

/// Reads `folder/image%04d.png`, named as vpVideoReader does, or a folder whose images differ in one number.
///
/// Every number between the first and the last image is a frame (where all are 5 apart, every fifth): one that is not
/// there is `missing`, one that cannot be decoded `corrupt`, one of another size `resized`, one with the
/// pixels of the frame before `stale`. Stamps are (number - first) / SourceOptions::frame_rate_hz.
///
/// vpVideoReader itself is not used for the pixels: it leaves out images it cannot read without a word, so that every
/// later frame would get the time of an earlier one. Its parser of names (vpIoTools::getIndex) is.
///
/// Errors: vpException when there is no such image, none can be read, or the camera is of another size.
class SequenceSource : public ImageFilesSource
{
public:
  explicit SequenceSource(const std::string &pattern, const SourceOptions &options = {});
  std::string note() const override;
  /// What is assumed about the rate of the images, and how to tell another; empty where it was told.
  const std::string &rateNote() const { return m_rate_note; }

  /// The pattern of a folder of numbered images, or empty.
  static std::string patternOf(const std::string &folder);
  /// Whether \p path has the name of a picture.
  static bool isImage(const std::string &path);

private:
  std::string m_rate_note;
};

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
