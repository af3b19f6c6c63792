// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A finished run against the ground truth of its sequence: what `bole evaluate` prints.

#include "evaluation/trajectory_metrics.h"
#include "evaluation/trunk_metrics.h"

#include <array>
#include <optional>
#include <string>

namespace bole
{
struct TrajectoryReport
{
  std::array<TrajectoryErrors, 4> absolute; ///< by Alignment
  PlanarTransform scaled;                   ///< the transform of Alignment::xy_yaw_scale
  RelativeErrors over_frame,
      over_second; ///< relative errors between consecutive frames and over 1 s
};

struct EvaluationOptions
{
  /// For live flights, whose stamps are the drone's: shift the run's stamps by motionShift().
  bool align_time = false;
};

struct Evaluation
{
  std::string run, sequence;
  bool is_against_run = false;              ///< `sequence` is another run
  std::optional<double> time_shift_s;       ///< added to the run's stamps, where that was asked for
  std::size_t frames = 0;                   ///< of the sequence
  TrajectoryReport smoothed;                ///< trajectory.tum
  std::optional<TrajectoryReport> online;   ///< trajectory_online.tum
  std::optional<TrajectoryReport> odometry; ///< the pose filter at the frames of trajectory.tum
  std::optional<TrunkMetrics> trunks;       ///< where the sequence has trees.csv
  std::string reference; ///< describe() of the run's metre and up, from its summary.json; empty without one
};

/// Compares the folder \p run (trajectory.tum, trunks.csv) with the ASL folder \p sequence, or with
/// another run: then its smoothed trajectory and its confirmed trunks stand for the truth, all of
/// them expected, and what is measured is how alike two runs are. Errors: vpException naming the
/// file that is missing or faulty, or that has no common stamps with the truth. Where the summary of
/// the run says that its metre is not odometry's, trunks are matched after alignment in scale too;
/// where its world stands at the height of the first camera, the mean height is aligned.
Evaluation evaluate(const std::string &run, const std::string &sequence, const EvaluationOptions &options = {});

/// The table for a terminal. \p verbose lists every trunk of the truth that counts with its match
/// or its nearest neighbour, and every false positive and duplicate.
std::string toTable(const Evaluation &evaluation, bool verbose);

/// Everything, as JSON.
std::string toJson(const Evaluation &evaluation);
} // namespace bole
