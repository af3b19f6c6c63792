// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/summary_json.h"

#include "bole_commit.h"

#include <bole/visp.h>
#include <fmt/format.h>
#include <opencv2/core/version.hpp>

extern "C" {
#include <libavutil/avutil.h>
}

namespace bole
{
std::map<std::string, std::string> versions()
{
  return {{"bole", BOLE_VERSION},
          {"commit", BOLE_COMMIT},
          {"visp", fmt::format("{}.{}.{}", VISP_VERSION_MAJOR, VISP_VERSION_MINOR, VISP_VERSION_PATCH)},
          {"opencv", CV_VERSION},
          {"libav", av_version_info()}};
}
} // namespace bole
