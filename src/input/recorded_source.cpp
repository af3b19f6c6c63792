// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/recorded_source.h"

#include "geometry/failure.h"
#include "input/user_text.h"
#include "input/video_file.h"

#include <filesystem>
#include <limits>

namespace bole
{
const ImageRow *firstReadable(const std::vector<ImageRow> &rows, ImageFile &file)
{
  std::string fault;
  for (const ImageRow &row : rows) {
    file = readImageFile(row.path);
    if (file.status == FrameStatus::ok)
      return &row;
    fault = fault.empty() ? file.message : fault;
  }
  file.message = fault;
  return nullptr;
}

std::string ImageFilesSource::pictureName(std::size_t index) const
{
  return index < m_rows.size() ? std::filesystem::path(m_rows[index].path).filename().string() : std::string();
}

bool ImageFilesSource::next(Frame &frame)
{
  if (m_at >= m_rows.size())
    return false;
  const ImageRow &row = m_rows[m_at++];
  m_builder->build(row.stamp_ns, readImageFile(row.path, m_builder->inputWidth(), m_builder->inputHeight()), frame);
  return true;
}

VideoSource::VideoSource(const std::string &path, const SourceOptions &options)
    : VideoSource(path, options, std::make_unique<VideoFile>(path))
{
}

VideoSource::VideoSource(const std::string &path, const SourceOptions &options, std::unique_ptr<VideoFile> file)
{
  m_name = withoutSecrets(path);
  requireUsed(options, m_name, kVideo);
  m_file = std::move(file);
  const vpImage<unsigned char> &first = m_file->firstWhole().image;
  const std::int64_t duration_ns = m_file->duration_ns();
  constexpr double kFastest_hz = 500;
  if (const double rate_hz = 1e9 * static_cast<double>(m_file->frames()) / static_cast<double>(duration_ns);
      duration_ns > 0 && rate_hz > kFastest_hz)
    throw badValue("{}: {:.0f} pictures a second by its container, must be at most {:g} (`ffmpeg -r RATE -i` gives it "
                   "another rate)",
                   m_name, rate_hz, kFastest_hz);
  const MountedCamera camera = cameraFor(options, static_cast<int>(first.getWidth()),
                                         static_cast<int>(first.getHeight()), m_note, m_file->pixelAspect());
  Recording recording;
  recording.odometry = readOdometry(options);
  // A video that does not tell its length meets every odometry that is not over before it begins.
  requireOverlap(recording.odometry, 0, duration_ns > 0 ? duration_ns : std::numeric_limits<std::int64_t>::max(),
                 options.odometry_path, m_name);
  m_builder = std::make_unique<FrameBuilder>(camera, options, std::move(recording));
}

VideoSource::~VideoSource() = default;

bool VideoSource::next(Frame &frame)
{
  Picture picture;
  if (!m_file->next(picture))
    return false;
  ImageFile file;
  file.status = picture.is_missing ? FrameStatus::missing : picture.is_damaged ? FrameStatus::corrupt : FrameStatus::ok;
  file.message = std::move(picture.message);
  file.image = std::move(picture.image);
  m_builder->build(picture.stamp_ns, std::move(file), frame);
  return true;
}

std::size_t VideoSource::size() const { return m_file->frames(); }
} // namespace bole
