// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Options of MonocularMotion, the keys `visual.*` of a configuration.

namespace bole
{
struct VisualOdometryOptions
{
  double camera_height = 0;         ///< of the camera over the ground, where it is known [m]; 0 (unknown) to 100
  double camera_height_sigma = 0.1; ///< of camera_height, in proportion, 1e-3 to 1
  double start_height = 1.5;        ///< taken for the camera's until the trunks say better [m], 0.1 to 100
  double start_depth = 8;         ///< median depth of the points where no ground is seen at the start [m], 0.5 to 1000
  double start_sigma = 0.5;       ///< of the log of the scale that these two give, 0.05 to 5
  double step_sigma = 0.004;      ///< least noise of a step [m], 1e-5 to 1
  double step_scale_sigma = 0.02; ///< error of a step in proportion to its length, 0 to 1
  double turn_sigma = 0.0004;     ///< least noise of a turn [rad], 1e-6 to 1
  double still_sigma = 0.03;      ///< of a step before any parallax was seen [m], 1e-4 to 10
  int max_iterations = 2;         ///< of the smoother a frame, at most: no pose filter holds the path, so what a false
                                  ///< trunk pulls before it is given up is kept short, 1 to 100
  bool focal_known = true;        ///< false: a guess, so a sideways flight needs better proof against a pan

  void validate() const; ///< \throw vpException naming the option, its value and the range
};
} // namespace bole
