// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The field of view of a video that came without a camera file.

#include <bole/open_source.h>

namespace bole::apps
{
struct FieldOfView
{
  double degrees = 0, sigma_degrees = 0; ///< horizontal; 0 where the video does not tell
};

/// From the first \p frames_most frames of \p input, where the camera turns or flies a curve in them.
FieldOfView fieldOfView(const std::string &input, const SourceOptions &options, int frames_most = 200);
} // namespace bole::apps
