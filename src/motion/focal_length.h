// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The focal length of a camera that turns, from its points alone: for a video without a calibration.
///
/// Idea: under the right focal length one rotation carries all far points from one frame to another; under a wrong one
/// those at the border of the image are left behind. So each pair of frames that the camera turned between is explained
/// by a robust rotation under a grid of focal lengths, and the one with the smallest residuals over all pairs wins. A
/// flight does not qualify: its flow is no rotation under any focal length.
///
/// Laws (each a test): points seen by a turning camera give its focal length from a guess that is off by a factor of
/// two; a camera that flies past points leaves it unknown.
///
/// Cost: 2 ms a frame on top of the tracker. Not thread-safe.

#include "motion/point_tracker.h"
#include "motion/relative_pose.h"

#include <vector>

namespace bole
{
struct FocalOptions
{
  int frames_back = 8;         ///< between the frames of a pair, 1 to 31
  int every = 2;               ///< frames between two pairs, 1 to 100
  double min_flow = 0.04;      ///< median flow of a pair, of the width of the image, 0.005 to 1
  double max_residual = 0.025; ///< residual of a pair over its flow that is still a rotation, 0.001 to 1; a real
                               ///< video that pans leaves 0.01, flights through trees 0.02 to 0.1
  int min_pairs = 5;           ///< that are rotations, and no fewer than half of those that moved, 2 to 1000
  double max_sigma = 0.15;     ///< of the log of the focal length, by leaving parts of the video out, 0.01 to 1
};

struct FocalEstimate
{
  bool known = false;
  double factor = 1; ///< of the guess
  double sigma = 0;  ///< relative
  int pairs = 0;     ///< of frames that turned
};

class FocalFromTurning
{
public:
  /// \p guess: of the camera, right to a factor of 4.
  explicit FocalFromTurning(const PinholeCamera &guess, const FocalOptions &options = {});

  /// Takes in the current frame of \p tracker.
  void add(const PointTracker &tracker);
  FocalEstimate estimate() const;

private:
  PinholeCamera m_guess;
  FocalOptions m_options;
  int m_frames = 0, m_moved = 0;             ///< frames seen; pairs with flow enough
  std::vector<std::vector<double>> m_curves; ///< log residual over the focal length, of the pairs that are rotations
};
} // namespace bole
