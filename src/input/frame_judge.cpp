// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/open_source.h>

#include "geometry/median.h"
#include "geometry/so3.h"
#include "input/image_health.h"

#include <algorithm>
#include <deque>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr double kLargestGyroGap_s = 0.05; // beyond, the rotation between two samples is a guess
constexpr double kLargestTurn_rad = 1;     // beyond, hardly a point is in both pictures, and a gyro is wrong
constexpr double kLeastGap_s = 0.5;        // as a gyro or an odometry is called silent; a gap of less costs no trunk
constexpr double kUnusual = 3;             // two frames in a row that did not come
constexpr std::size_t kFewestIntervals = 3, kMostIntervals = 15; // that tell what is usual

/// Rotation vector of the body over (\p from_ns, \p to_ns]; nothing where the samples do not cover it.
std::optional<Eigen::Vector3d> integrated(const std::vector<GyroSample> &gyro, std::int64_t from_ns, std::int64_t to_ns)
{
  Eigen::Vector3d angle = Eigen::Vector3d::Zero();
  std::int64_t last_ns = from_ns;
  for (const GyroSample &sample : gyro) {
    const double elapsed_s = static_cast<double>(sample.stamp_ns - last_ns) * 1e-9;
    if (elapsed_s > kLargestGyroGap_s || elapsed_s < 0)
      return std::nullopt;
    angle += elapsed_s * sample.rate;
    last_ns = sample.stamp_ns;
  }
  const double rest_s = static_cast<double>(to_ns - last_ns) * 1e-9;
  if (gyro.empty() || rest_s > kLargestGyroGap_s)
    return std::nullopt;
  return (angle + rest_s * gyro.back().rate).eval();
}
} // namespace

struct FrameJudge::State
{
  void judgeInterval(Frame &frame);
  MeasuredRotation motionTo(const Frame &frame) const;
  void judge(Frame &frame);

  double focal_px;
  Pose bMc;
  ImageHealth health = ImageHealth();
  std::optional<std::int64_t> last_stamp_ns = {};
  std::deque<double> intervals_s = {}; ///< the last ones
  std::optional<Pose> last_odometry = {};
};

MeasuredRotation FrameJudge::State::motionTo(const Frame &frame) const
{
  MeasuredRotation motion;
  motion.focal_px = focal_px;
  if (!last_stamp_ns)
    return motion;
  motion.elapsed_s = 1e-9 * static_cast<double>(frame.stamp_ns - *last_stamp_ns);
  const Eigen::Matrix3d cRb = bMc.R.transpose();
  if (const auto angle = integrated(frame.gyro, *last_stamp_ns, frame.stamp_ns);
      angle && angle->norm() < kLargestTurn_rad)
    motion.gyro = cRb * *angle;
  if (last_odometry && frame.wMb_odometry)
    motion.odometry = cRb * logSo3(orthonormalized(last_odometry->R.transpose() * frame.wMb_odometry->R));
  return motion;
}

void FrameJudge::State::judgeInterval(Frame &frame)
{
  if (!last_stamp_ns)
    return;
  const double interval_s = 1e-9 * static_cast<double>(frame.stamp_ns - *last_stamp_ns);
  const double usual_s = medianOf({intervals_s.begin(), intervals_s.end()});
  intervals_s.push_back(interval_s);
  if (intervals_s.size() > kMostIntervals)
    intervals_s.pop_front();
  if (frame.status == FrameStatus::missing || intervals_s.size() <= kFewestIntervals ||
      interval_s <= std::max(kLeastGap_s, kUnusual * usual_s))
    return;
  frame.gap_s = interval_s;
  if (frame.message.empty())
    frame.message = fmt::format("no picture for {:.1f} s before it", interval_s);
}

void FrameJudge::State::judge(Frame &frame)
{
  const MeasuredRotation motion = motionTo(frame);
  judgeInterval(frame);
  last_stamp_ns = frame.stamp_ns;
  last_odometry = frame.wMb_odometry;
  if (frame.status != FrameStatus::ok || frame.image.getSize() == 0)
    return health.skip(motion);
  const ImageFault fault = health.check(frame.image, motion);
  if (fault == ImageFault::none)
    return;
  frame.status = fault == ImageFault::frozen       ? FrameStatus::stale
                 : fault == ImageFault::wrong_size ? FrameStatus::resized
                                                   : FrameStatus::doubtful;
  frame.message = health.reason();
}

FrameJudge::FrameJudge(const PinholeCamera &camera, const Pose &bMc) : m_state(new State{camera.fx, bMc}) {}
FrameJudge::~FrameJudge() = default;
FrameJudge::FrameJudge(FrameJudge &&) noexcept = default;
void FrameJudge::judge(Frame &frame) { m_state->judge(frame); }
} // namespace bole
