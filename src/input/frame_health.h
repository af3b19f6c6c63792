// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The one judge of frames: every source, and every program that is given images, asks it.

#include "input/image_health.h"
#include <bole/frame.h>

#include <deque>

namespace bole
{
/// Gives each frame its status and the reason by ImageHealth, with the gyro and the odometry that came with it.
///
/// A frame that comes far later than usual after the one before tells so (Frame::gap_s) and is used. Usual is the
/// median of the last intervals, so that a camera whose rate changes is one that changes its rate.
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
  void judgeInterval(Frame &frame);
  MeasuredRotation motionTo(const Frame &frame) const;

  ImageHealth m_health;
  double m_focal_px;
  Pose m_bMc;
  std::optional<std::int64_t> m_last_stamp_ns;
  std::deque<double> m_intervals_s; ///< the last ones
  std::optional<Pose> m_last_odometry;
};
} // namespace bole
