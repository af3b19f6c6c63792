// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Trackers side by side on the same frames of the same flight, from the same pose, with the same true model.
///
/// Every frame is given to every tracker before the next frame is looked at, so that all are timed under the
/// same load. Wrong is a pose more than 0.3 m or 5 degrees from the truth; a failure is silent when the
/// tracker did not complain about it.

#include <bole/baseline/contender.h>

#include <functional>

namespace bole
{
struct Limits
{
  double position_m = 0.3; ///< more is wrong
  double rotation_deg = 5;
};

struct FrameError
{
  double position_m = 0, rotation_deg = 0;
  bool complained = false, wrong = false;
  double ms = 0;
};

struct Score
{
  std::string name;
  TrackerKind kind = TrackerKind::trunk;
  Help help = Help::alone;
  std::string settings;
  int frames = 0;             ///< given to it, the first (its start) not counted
  int until_loss = 0;         ///< before the first that it complained about or got wrong
  int tracked = 0;            ///< without complaint and right
  int silent_failures = 0;    ///< wrong without complaint
  int reinitialisations = 0;
  double position_rmse_m = 0; ///< while tracked: until the first loss
  double rotation_rmse_deg = 0;
  double all_position_rmse_m = 0; ///< over all frames, whatever it said
  double all_rotation_rmse_deg = 0;
  double median_ms = 0, p95_ms = 0;
  std::vector<FrameError> errors; ///< a frame each, for plots
};

struct FrameErrorOf
{
  double position_m, rotation_deg;
};
/// Distance between two poses: of the camera centres [m] and of the attitudes [degrees].
FrameErrorOf poseError(const Pose &cMo, const Pose &truth);

/// Runs \p contenders over \p flight with the model \p cao_path; frames from \p image(k) where given.
using Progress = std::function<void(int frame, int frames)>;
std::vector<Score> compare(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                           const Limits &limits = {}, const Progress &progress = {});

/// The settings of a small sweep (mask, range, threshold, step, far clipping) under which \p kind with \p help
/// tracks longest, then most precisely, and all that were tried.
struct SweepResult
{
  EdgeSettings best;
  std::vector<std::pair<EdgeSettings, Score>> tried;
};
SweepResult sweep(const TestFlight &flight, const std::string &cao_path, TrackerKind kind, Help help,
                  const Limits &limits = {});
} // namespace bole
