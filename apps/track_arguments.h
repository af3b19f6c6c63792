// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What `bole track` is told: on the command line, or by the folder of a run that is to be repeated.

#include "commands.h"

#include <bole/ardrone_source.h>
#include <bole/open_source.h>

#include <memory>
#include <string>
#include <vector>

namespace bole::apps
{
struct TrackArguments
{
  std::string input, run, config, again, resumed;
  std::vector<std::string> settings, without;
  SourceOptions source;
  bool is_shown = false, has_video = true, is_quiet = false, is_profiled = false, is_online = false,
       is_without_odometry = false, is_without_gyro = false;
  std::size_t frames_most = 0;
  bool is_cut = false; ///< without a last look: as a run was that was killed after frames_most frames
  double give_up_s = ArDroneSource::Options().give_up_s;
  double camera_height = 0;
};

/// The options of `bole track`, to be kept in \p arguments.
void addTrackOptions(CLI::App &command, const std::shared_ptr<TrackArguments> &arguments);
/// What follows from the options that were given. \throw CLI::RequiredError for one that is missing.
void settle(const CLI::App &command, TrackArguments &arguments);

/// Tracks, writes the folder and reports.
void track(const TrackArguments &arguments);
/// Repeats the run in the folder `again` and tells whether the bytes agree. \throw vpException when it cannot be.
void trackAgain(const CLI::App &command, const TrackArguments &arguments);
/// Completes the run in the folder `resumed`, which was interrupted or killed. \throw vpException when it cannot be.
void resume(const CLI::App &command, const TrackArguments &arguments);
} // namespace bole::apps
