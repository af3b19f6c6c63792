// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Trackers side by side on the same frames of the same flight, from the same pose, with the same true model.
///
/// Every frame is given to every tracker before the next frame is looked at, in turning order, so that all are
/// timed under the same load. Wrong is a pose further from the truth than Limits; a failure is silent when the tracker
/// did not complain about it.
///
/// Cost: that of the trackers; sweep() runs one over the flight some twenty times.

#include "baseline/contender.h"

#include <functional>

namespace bole
{
struct FrameError
{
  double position_m = 0, rotation_deg = 0;
  bool complained = false, wrong = false;
  double ms = 0;
  Pose cMo; ///< its answer
};

struct Score
{
  std::string name;
  TrackerKind kind = TrackerKind::trunk;
  Help help = Help::alone;
  std::string settings;
  int frames = 0;          ///< given to it, the first (its start) not counted
  int until_loss = 0;      ///< before the first that it complained about or got wrong
  int tracked = 0;         ///< without complaint and right
  int silent_failures = 0; ///< wrong without complaint
  int reinitialisations = 0;
  double position_rmse_m = 0; ///< while tracked: until the first loss; NaN where it was lost at once
  double rotation_rmse_deg = 0;
  double all_position_rmse_m = 0; ///< over all frames, whatever it said
  double all_rotation_rmse_deg = 0;
  double median_ms = 0, p95_ms = 0;
  std::vector<FrameError> errors; ///< a frame each, for plots
};

struct PoseError
{
  double position_m, rotation_deg;
};
/// Distance between two poses: of the camera centres [m] and of the attitudes [degrees].
PoseError poseError(const Pose &cMo, const Pose &truth);

/// The image that is shown in place of that of frame k.
using ImageAt = std::function<const vpImage<unsigned char> &(std::size_t k)>;

/// Runs \p contenders over \p flight with the model \p cao_path, on the images of \p image_at where given.
std::vector<Score> compare(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                           const Limits &limits = {}, const ImageAt &image_at = {});

/// ViSP's settings by a small sweep on the flight itself, which favours ViSP: mask, range, threshold, step and far
/// clipping are varied one at a time from the best so far, twice through the list. Best is right in most frames,
/// then has the least error of position. A setting that is wrong for 15 frames in a row is not flown to the end.
struct SweepResult
{
  TrackerKind kind = TrackerKind::visp_edge;
  Help help = Help::alone;
  EdgeSettings best;
  std::vector<std::pair<EdgeSettings, Score>> tried;
};
SweepResult sweep(const TestFlight &flight, const std::string &cao_path, TrackerKind kind, Help help,
                  const Limits &limits = {});
} // namespace bole
