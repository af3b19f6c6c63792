// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far the camera may turn between two frames before a tracker loses the trunks.
///
/// Idea: a turn needs no depth to be rendered: one image of a flight, seen by a narrower camera turned by half the
/// step to one side and then to the other, is an exact pair of frames with all of the flight's clutter. Without
/// clutter the same pairs show the model alone, drawn flat before a plain sky and ground. Both frames of a pair get
/// their own sensor noise. A tracker starts at the true pose of the first, tracks it once (moving edges
/// learn their contrast there) and is then given the second: success is no complaint and a pose that is right.

#include "baseline/comparison.h"

namespace bole
{
struct BasinOptions
{
  std::vector<double> steps_px{1, 2, 4, 8, 12, 16, 24, 32}; ///< in the middle of the image (0 .. 32)
  int every = 8;                                            ///< frames of the flight between starts (1 ..)
  double range_m = 15;                                      ///< trunks further away are neither drawn nor in the model
  int min_trunks = 2;                                       ///< starts with fewer in view are left out
  double noise_grey = 1.5;                                  ///< standard deviation of the sensor noise added
  Limits limits{0.3, 1.0};                                  ///< right is within: 1 degree is 3.5 px at f = 200 px
  unsigned seed = 7;
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
} // namespace bole
