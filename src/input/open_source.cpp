// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/asl_source.h"
#include "input/sequence_source.h"
#include "input/video_source.h"
#include <bole/open_source.h>

#include <filesystem>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole
{
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
