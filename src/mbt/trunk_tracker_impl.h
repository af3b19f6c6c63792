// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The state of vpMbTrunkTracker.

#include "input/image_health.h"
#include "mbt/pose_estimator.h"

#include <visp3/core/vpColVector.h>

struct vpMbTrunkTracker::Impl
{
  bole::PoseEstimator estimator;
  bole::ImageHealth health;
  Status status = Status::not_initialised;
  std::string message;

  /// \throw vpException when \p trunk has no length or no radius.
  void add(const bole::Cylinder &trunk);
  /// One number of each found piece of the last frame.
  vpColVector collected(double bole::FoundPiece::*member) const;
};
