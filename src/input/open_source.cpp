// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/asl_source.h"
#include "input/sequence_source.h"
#include "input/video_source.h"
#include <bole/open_source.h>

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
template <typename Value> void require(bool holds, const char *name, Value value, const char *must_be)
{
  if (!holds)
    throw vpException(vpException::badValue, fmt::format("{} = {}, must be {}", name, value, must_be));
}
} // namespace

void SourceOptions::validate() const
{
  require(std::isfinite(odometry_offset_s), "odometry_offset_s", odometry_offset_s, "finite");
  require(max_odometry_gap_s > 0 && max_odometry_gap_s < 1e6, "max_odometry_gap_s", max_odometry_gap_s, "above 0 s");
  require(frame_rate_hz >= 1e-3 && frame_rate_hz <= 1e4, "frame_rate_hz", frame_rate_hz, "0.001 to 10000 Hz");
  require(max_width_px == 0 || (max_width_px >= 64 && max_width_px <= 16384), "max_width_px", max_width_px,
          "0 (keep the size) or 64 to 16384 px");
  require(field_of_view_deg >= 10 && field_of_view_deg <= 150, "field_of_view_deg", field_of_view_deg,
          "10 to 150 degrees");
}

std::unique_ptr<FrameSource> openSource(const std::string &input, const SourceOptions &options)
{
  if (AslSource::accepts(input))
    return std::make_unique<AslSource>(input, options);
  if (std::filesystem::is_directory(input)) {
    if (SequenceSource::patternOf(input).empty())
      throw vpException(vpException::ioError,
                        fmt::format("{}: must be an ASL folder (cam0/data.csv) or hold numbered images", input));
    return std::make_unique<SequenceSource>(input, options);
  }
  if (std::filesystem::path(input).filename().string().find('%') != std::string::npos)
    return std::make_unique<SequenceSource>(input, options);
  return std::make_unique<VideoSource>(input, options);
}
} // namespace bole
