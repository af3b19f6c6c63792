// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "input/live_video.h"
#include "input/recorded_source.h"
#include <bole/open_source.h>

#include <filesystem>

namespace bole
{
void SourceOptions::validate() const
{
  requireRange("odometry_offset_s", odometry_offset_s, -1e9, 1e9);
  if (frame_rate_hz)
    requireRange("frame_rate_hz", *frame_rate_hz, 1e-3, 1e4);
  if (max_width_px != 0) // keeps the size
    requireRange("max_width_px", max_width_px, 64, 16384);
  if (field_of_view_deg)
    requireRange("field_of_view_deg", *field_of_view_deg, 10, 150);
  requireRange("distortion_k1", distortion_k1, -10, 10);
}

void requireUsed(const SourceOptions &options, const std::string &input, const SourceKind &kind)
{
  options.validate();
  const auto require = [&input](bool is_used, const char *option, const std::string &reason) {
    if (!is_used)
      throw badValue("{}: {} has no effect: {}", input, option, reason);
  };
  const std::string name = kind.name;
  const bool has_odometry = !options.odometry_path.empty(), has_camera = !options.camera_path.empty();
  require(!has_camera || kind.takes_camera, "camera_path (--camera)", name + " has a camera of its own");
  require(!has_odometry || kind.takes_odometry, "odometry_path (--odometry)", name + " has none but its own");
  require(options.odometry_offset_s == 0 || has_odometry, "odometry_offset_s (--odometry-offset)",
          "no odometry file is given");
  require(!options.frame_rate_hz || kind.takes_rate, "frame_rate_hz (--rate)", name + " has stamps of its own");
  require(!options.field_of_view_deg || !(kind.has_camera || has_camera), "field_of_view_deg (--field-of-view)",
          "the camera is known");
  require(options.distortion_k1 == 0 || !(kind.has_camera || has_camera), "distortion_k1", "the camera is known");
}

std::unique_ptr<FrameSource> openSource(const std::string &input, const SourceOptions &options)
{
  namespace fs = std::filesystem;
  std::error_code error;
  const bool is_file = fs::is_regular_file(input, error);
  if (LiveVideoSource::accepts(input))
    return openStream(input, options);
  if (AslSource::accepts(input))
    return std::make_unique<AslSource>(input, options);
  if (fs::is_directory(input, error)) {
    if (SequenceSource::patternOf(input).empty())
      throw ioError("{}: must be an ASL folder (cam0/data.csv) or hold numbered images", input);
    return std::make_unique<SequenceSource>(input, options);
  }
  if (!is_file && fs::path(input).filename().string().find('%') != std::string::npos)
    return std::make_unique<SequenceSource>(input, options);
  if (is_file && SequenceSource::isImage(input))
    throw ioError("{}: is one picture, must be a video, a folder of pictures or a pattern such as %04d.png", input);
  return std::make_unique<VideoSource>(input, options);
}
} // namespace bole
