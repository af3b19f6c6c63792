// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "geometry/require_range.h"
#include "input/asl_source.h"
#include "input/live_video.h"
#include "input/sequence_source.h"
#include "input/video_source.h"
#include <bole/open_source.h>

#include <filesystem>

namespace bole
{
void SourceOptions::validate() const
{
  requireRange("odometry_offset_s", odometry_offset_s, -1e9, 1e9);
  requireRange("max_odometry_gap_s", max_odometry_gap_s, 1e-9, 1e6);
  if (frame_rate_hz)
    requireRange("frame_rate_hz", *frame_rate_hz, 1e-3, 1e4);
  if (max_width_px != 0) // keeps the size
    requireRange("max_width_px", max_width_px, 64, 16384);
  requireRange("field_of_view_deg", field_of_view_deg, 10, 150);
}

std::unique_ptr<FrameSource> openSource(const std::string &input, const SourceOptions &options)
{
  if (LiveVideoSource::accepts(input))
    return openStream(input, options);
  if (AslSource::accepts(input))
    return std::make_unique<AslSource>(input, options);
  if (std::filesystem::is_directory(input)) {
    if (SequenceSource::patternOf(input).empty())
      throw ioError("{}: must be an ASL folder (cam0/data.csv) or hold numbered images", input);
    return std::make_unique<SequenceSource>(input, options);
  }
  if (std::filesystem::path(input).filename().string().find('%') != std::string::npos)
    return std::make_unique<SequenceSource>(input, options);
  return std::make_unique<VideoSource>(input, options);
}
} // namespace bole
