// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/frame_builder.h"
#include "input/video_file.h"

#include "input/video_source.h"

#include <deque>
#include <fmt/format.h>
#include <limits>
#include <visp3/core/vpException.h>

namespace bole
{
struct VideoSource::State
{
  State(const std::string &path, const SourceOptions &options) : name(path), file(path)
  {
    readAhead();
    const Picture &first = ahead.back();
    camera =
        cameraFor(options, static_cast<int>(first.image.getWidth()), static_cast<int>(first.image.getHeight()), note);
  }

  /// Reads up to the first whole picture, whose size is that of the video.
  void readAhead()
  {
    Picture picture;
    while (file.next(picture)) {
      ahead.push_back(std::move(picture));
      if (!ahead.back().is_damaged)
        return;
    }
    throw vpException(vpException::ioError,
                      fmt::format("{}: none of its {} pictures can be decoded", name, ahead.size()));
  }

  bool take(Picture &picture)
  {
    if (ahead.empty())
      return file.next(picture);
    picture = std::move(ahead.front());
    ahead.pop_front();
    return true;
  }

  std::string name;
  std::string note;
  VideoFile file;
  std::deque<Picture> ahead;
  MountedCamera camera;
  std::unique_ptr<FrameBuilder> builder;
};

VideoSource::VideoSource(const std::string &path, const SourceOptions &options)
{
  options.validate();
  m_state = std::make_unique<State>(path, options);
  Recording recording;
  recording.odometry = readOdometry(options);
  // A video that does not tell its length meets every odometry that is not over before it begins.
  const std::int64_t duration_ns = m_state->file.duration_ns();
  requireOverlap(recording.odometry, 0, duration_ns > 0 ? duration_ns : std::numeric_limits<std::int64_t>::max(),
                 options.odometry_path, path);
  m_state->builder = std::make_unique<FrameBuilder>(m_state->camera, options, std::move(recording));
}

VideoSource::~VideoSource() = default;

bool VideoSource::next(Frame &frame)
{
  Picture picture;
  if (!m_state->take(picture))
    return false;
  ImageFile file;
  file.status = picture.is_missing ? FrameStatus::missing : picture.is_damaged ? FrameStatus::corrupt : FrameStatus::ok;
  file.message = std::move(picture.message);
  file.image = std::move(picture.image);
  m_state->builder->build(picture.stamp_ns, std::move(file), frame);
  return true;
}

PinholeCamera VideoSource::camera() const { return m_state->builder->camera(); }
Pose VideoSource::bMc() const { return m_state->builder->bMc(); }
std::size_t VideoSource::size() const { return m_state->file.frames(); }
std::string VideoSource::name() const { return m_state->name; }
bool VideoSource::hasOdometry() const { return !m_state->builder->recording().odometry.empty(); }
bool VideoSource::hasGyro() const { return false; }
bool VideoSource::isCameraKnown() const { return m_state->note.empty(); } // the note tells of a guess
std::string VideoSource::note() const { return m_state->note; }
} // namespace bole
