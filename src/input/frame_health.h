// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The one judge of frames: every source, and every program that is given images, asks it.

#include "input/image_health.h"
#include <bole/frame.h>

namespace bole
{
/// Gives each frame its status and the reason by ImageHealth, with the gyro and the odometry that came with it.
///
/// A frame that was `ok` becomes `stale` (frozen), `resized`, or `doubtful` with a message; others stay as they are.
/// Images may be raw or rectified, but always the same.
class FrameHealth
{
public:
  /// \param camera of the images judged; only its focal length is used.
  FrameHealth(const PinholeCamera &camera, const Pose &bMc);
  void judge(Frame &frame);

private:
  MeasuredRotation motionTo(const Frame &frame) const;

  ImageHealth m_health;
  double m_focal_px;
  Pose m_bMc;
  std::optional<std::int64_t> m_last_stamp_ns;
  std::optional<Pose> m_last_odometry;
};
} // namespace bole
