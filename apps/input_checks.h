// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Options about the input that would have no effect on it are refused.

#include "geometry/failure.h"
#include "input/live_video.h"
#include <bole/ardrone_source.h>
#include <bole/frame.h>

#include <CLI/CLI.hpp>

namespace bole::apps
{
/// Throws where a height of the camera is given [m], and \p source tells the scale itself.
inline void requireHeightUsed(double camera_height, const FrameSource &source)
{
  if (camera_height > 0 && source.hasOdometry())
    throw badValue("{}: --camera-height has no effect: the odometry tells the scale", source.name());
}

/// Throws where \p command was told how long a live stream may be silent, and \p input is none.
inline void requireGiveUpUsed(const CLI::App &command, const std::string &input)
{
  if (command.count("--give-up") > 0 && !LiveVideoSource::accepts(input) && !ArDroneSource::accepts(input))
    throw badValue("{}: --give-up has no effect: a recording ends by itself", input);
}
} // namespace bole::apps
