// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Opens a video that came without a camera file: where it turns or flies a curve in its first frames, they tell its
/// field of view.

#include <bole/open_source.h>

#include <memory>
#include <string>

namespace bole
{
struct MeasuredSource
{
  std::unique_ptr<FrameSource> source;
  SourceOptions options;              ///< that open the same once more
  std::string note;                   ///< what is assumed about camera and rate; empty where nothing is
  bool is_camera_known = true;        ///< false: the field of view is a guess
  double field_of_view_sigma_deg = 0; ///< of one that was measured; 0: of a calibration, or given
};

/// As openSource(), or openStream() with \p give_up_s, whose video cannot be looked through twice.
MeasuredSource openMeasured(const std::string &input, const SourceOptions &options, double give_up_s);

/// Standard deviation of the log of the focal length of \p source (Options::Camera::focal_sigma), with what is said of
/// it in a MeasuredSource.
double focalSigma(const FrameSource &source, bool is_camera_known, double field_of_view_sigma_deg);
} // namespace bole
