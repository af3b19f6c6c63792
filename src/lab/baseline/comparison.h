// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Trackers side by side on the same frames of the same flight, from the same pose, with the same true model.
///
/// Every frame is given to every tracker before the next frame is looked at, in turning order, so that all are
/// timed under the same load. Wrong is a pose further from the truth than the flight's Limits; a failure is silent when
/// the tracker did not complain about it.
///
/// Cost: that of the trackers; sweep() runs one over the flight some twenty times.

#include "baseline/contender.h"
#include "faults/fault.h"

#include <functional>
#include <string>
#include <vector>

namespace bole
{
struct PoseError
{
  double position_m = 0, rotation_deg = 0;
};
/// Distance between two poses: of the camera centres [m] and of the attitudes [degrees].
PoseError poseError(const Pose &cMo, const Pose &truth);

/// What a tracker answered on one frame, and how far it was off.
struct FrameError : Answer, PoseError
{
  bool wrong = false;
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

/// The image that is shown in place of that of frame k.
using ImageAt = std::function<const vpImage<unsigned char> &(std::size_t k)>;

/// Runs \p contenders over \p flight with the model \p cao_path, on the images of \p image_at where given.
std::vector<Score> compare(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                           const ImageAt &image_at = {});

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
SweepResult sweep(const TestFlight &flight, const std::string &cao_path, TrackerKind kind, Help help);

// How far the camera may turn between two frames before a tracker loses the trunks.
//
// Idea: a turn needs no depth to be rendered: one image of a flight, seen by a narrower camera turned by half the
// step to one side and then to the other, is an exact pair of frames with all of the flight's clutter. Without
// clutter the same pairs show the model alone, drawn flat before a plain sky and ground. Both frames of a pair get
// their own sensor noise. A tracker starts at the true pose of the first, tracks it once (moving edges
// learn their contrast there) and is then given the second: success is no complaint and a pose that is right.

struct BasinOptions
{
  std::vector<double> steps_px{1, 2, 4, 8, 12, 16, 24, 32}; ///< in the middle of the image (0 .. 32)
  double range_m = 15;                                      ///< trunks further away are neither drawn nor in the model
  int min_trunks = 2;                                       ///< starts with fewer in view are left out
};

struct BasinRow
{
  std::string name, settings;
  bool has_clutter = false;
  int pairs = 0;                         ///< a step size
  std::vector<double> steps_px, success; ///< share of the pairs, a step size each
  std::vector<double> silent;            ///< share that was wrong without complaint
};

/// A pair of frames as the basin test shows them, for looking at and for tests.
struct TurnedPair
{
  PinholeCamera camera;
  TestFrame before, after;
};
TurnedPair turnedPair(const TestFlight &flight, std::size_t k, double step_px, bool has_clutter,
                      const BasinOptions &options);

/// Success of \p contender on every step; a row. The contender should have no help.
BasinRow basin(const TestFlight &flight, const std::string &cao_path, Contender &contender, bool has_clutter,
               const BasinOptions &options = {});

// What trackers say and do when the camera or its link fails for a few frames.
//
// Idea: pieces of a flight, each started at the true pose a few frames before some of its images are replaced. A
// failure is silent when the pose is wrong and nothing is said, during the fault or after it. Recovered is the first
// frame after the fault that is right without complaint and stays so for two more; nobody helps beyond what Help says.

struct FaultCase
{
  FaultKind kind = FaultKind::black;
  int frames = 1; ///< in a row
  std::string text() const;
};
/// Black and noise for 1 and 5 frames, a smeared half for 1, frozen for 10, a wrong size for 1.
std::vector<FaultCase> allFaults();

/// Where the pieces of the flight lie.
struct FaultRuns
{
  std::vector<std::size_t> begins{20, 40, 60,
                                  80}; ///< frames at which the fault begins; those near the end are left out
  int lead = 5;                        ///< frames tracked before it
  int tail = 15;                       ///< and after it
};

struct FaultRow
{
  std::string name;
  FaultCase fault;
  int runs = 0;
  int fault_frames = 0, noticed = 0; ///< frames replaced, and those at which the tracker complained
  int silent_failures = 0;           ///< frames wrong without complaint, from the beginning of the fault
  int recovered = 0;                 ///< runs
  int slowest = 0;                   ///< frames to recovery in the slowest run that recovered; 1: at once
};

/// Rows of all \p contenders, a fault each, in the order of allFaults().
std::vector<FaultRow> faults(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                             const FaultRuns &runs = {});

// A comparison as text for the terminal, as JSON for programs (apps/campaign/figures.py draws it), and as a video in
// which each tracker shows where it believes the model to be.

struct ComparisonReport
{
  std::string sequence, command;
  int frames = 0, trunks = 0; ///< of the flight; of the model
  Limits limits;
  std::vector<Score> scores;
  std::vector<SweepResult> sweeps;
  std::vector<Score> timing; ///< on the true pose, the same trunks for all; empty: not measured
  std::vector<BasinRow> basin;
  std::vector<FaultRow> faults;
};

std::string toTable(const ComparisonReport &report);
std::string toJson(const ComparisonReport &report);

/// Writes a video of two columns to \p path (mp4): a picture for each of \p scores that had a prior, with the model
/// \p cao_path drawn where its pose puts it and its error below: green where it is right, orange where it complained,
/// red where it is wrong in silence. Nothing is written when there is none.
///
/// \throw vpException naming the file, when it cannot be written.
void writeComparisonVideo(const std::string &path, const TestFlight &flight, const std::string &cao_path,
                          const std::vector<Score> &scores);
} // namespace bole
