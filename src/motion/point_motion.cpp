// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/point_motion.h"

#include "geometry/constants.h"
#include "motion/accelerometer.h"
#include "motion/row_shear.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
PointMotion::PointMotion(const PinholeCamera &camera, const Pose &bMc, const PointMotionOptions &options)
    : m_camera(camera), m_bMc(bMc), m_options(options), m_tracker(camera)
{
  m_bias = GyroBias::unknown(options.gyro);
}

void PointMotion::track(const Frame &frame)
{
  const std::size_t number = m_frames++;
  m_fault.clear();
  m_gyro.insert(m_gyro.end(), frame.gyro.begin(), frame.gyro.end());
  if (frame.status != FrameStatus::ok)
    return;
  Eigen::Matrix3d expected = Eigen::Matrix3d::Identity();
  m_turned = m_seen.empty() ? std::nullopt : gyroSince(m_seen.back().stamp_ns, frame.stamp_ns);
  if (m_turned)
    expected = m_bMc.R.transpose() * m_turned->R * m_bMc.R;
  m_tracker.track(frame.image, expected);
  m_seen.push_back({frame.stamp_ns, number, frame.wMb_odometry});
  if (m_seen.size() > static_cast<std::size_t>(PointTracker::kHistory))
    m_seen.pop_front();
  const auto recent = std::find_if(m_gyro.begin(), m_gyro.end(), [this](const GyroSample &sample) {
    return sample.stamp_ns >= m_seen.front().stamp_ns;
  });
  if (recent - m_gyro.begin() > 1) // one sample before the oldest frame helps its rate
    m_gyro.erase(m_gyro.begin(), recent - 1);
}

std::vector<RelativeMotion> PointMotion::process(const Frame &frame)
{
  track(frame);
  std::vector<RelativeMotion> motions;
  if (frame.status != FrameStatus::ok)
    return motions;
  if (m_good_frames % m_options.every == 0)
    for (int back : m_options.frames_back)
      if (static_cast<std::size_t>(back) < m_seen.size())
        motions.push_back(relativeTo(back));
  judgeShear(motions);
  if (!m_fault.empty())
    motions.clear();
  else
    ++m_good_frames;
  return motions;
}

std::optional<GyroRotation> PointMotion::gyroSince(std::int64_t from_ns, std::int64_t to_ns) const
{
  if (m_gyro.empty() || m_gyro.back().stamp_ns <= from_ns)
    return std::nullopt;
  return integrateGyro(m_gyro, from_ns, to_ns, m_bias, m_options.gyro);
}

/// What gyro and pose filter say of the motion from the frame \p frames_back before to the newest; the same into \p
/// step.
RelativePosePrior PointMotion::expect(RelativeMotion &step, int frames_back, bool with_odometry) const
{
  const Seen &a = *(m_seen.rbegin() + frames_back), &b = m_seen.back();
  step.frames_back = frames_back;
  step.a_ns = a.stamp_ns;
  step.b_ns = b.stamp_ns;
  step.a_index = a.index;
  step.b_index = b.index;
  RelativePosePrior prior;
  step.gyro = frames_back == 1 ? m_turned : gyroSince(a.stamp_ns, b.stamp_ns);
  if (step.gyro) {
    prior.aRb = m_bMc.R.transpose() * step.gyro->R * m_bMc.R;
    prior.rotation_covariance = m_bMc.R.transpose() * step.gyro->covariance() * m_bMc.R;
  }
  if (with_odometry && a.wMb && b.wMb) {
    const Pose wMa = *a.wMb * m_bMc, wMb = *b.wMb * m_bMc;
    prior.translation = (wMa.inverse() * wMb).t;
    const double walk2 = std::pow(odometry::kWalk, 2) * secondsOf(b.stamp_ns - a.stamp_ns);
    const double height2 = std::pow(odometry::kHeightSigma, 2);
    const Eigen::Matrix3d world = Eigen::Vector3d(walk2, walk2, height2).asDiagonal();
    const double relative = odometry::kRelativeSigma * prior.translation->norm();
    prior.translation_covariance =
        wMa.R.transpose() * world * wMa.R + relative * relative * Eigen::Matrix3d::Identity();
  }
  return prior;
}

RelativeMotion PointMotion::relativeTo(int frames_back) const
{
  RelativeMotion step;
  const RelativePosePrior prior = expect(step, frames_back, false);
  const std::vector<PointMatch> matches = m_tracker.matches(frames_back);
  step.estimate = estimateRelativePose(matches, m_camera, prior, m_options.min_sigma_px);
  if (frames_back == m_options.widest())
    step.points = prior.aRb ? estimateRelativePose(matches, m_camera, {}, m_options.min_sigma_px) : step.estimate;
  return step;
}

/// Whether the rows of the newest image stand askew to those of the last good one, as by a rolling shutter that is
/// shaken; it is forgotten then. Without gyro and odometry a flight explains as much.
void PointMotion::judgeShear(const std::vector<RelativeMotion> &motions)
{
  constexpr double kLean = 0.015;   // of upright trunks [rad]: 3 px over 200 rows
  constexpr double kSigmas = 6;     // of the fit; recorded images in order: at most 4.3 in 4000 pairs of them
  constexpr double kFirstGain = 30; // chi-squared; images in order: at most 22, where corners slide along a trunk
  constexpr double kGain = 9;       // once there was one: a shutter shears image after image
  constexpr std::int64_t kLasts_ns = 1'000'000'000;
  constexpr int kMostRefused = 10; // in a row: then the camera has changed for good
  if (m_seen.size() < 2)
    return;
  RelativeMotion step;
  const RelativePosePrior prior = expect(step, 1, true);
  if (!prior.aRb && !prior.translation)
    return;
  const auto seen = std::find_if(motions.begin(), motions.end(), [](const auto &m) { return m.frames_back == 1; });
  const std::vector<PointMatch> matches = m_tracker.matches(1);
  const RelativePoseEstimate rigid =
      seen != motions.end() ? seen->estimate : estimateRelativePose(matches, m_camera, prior, m_options.min_sigma_px);
  const Pose seen_start(rigid.aRb, rigid.direction);
  const std::optional<Eigen::Vector3d> ahead = prior.translation ? prior.translation : m_ahead;
  const bool has_start = ahead && ahead->norm() > 0;
  const Pose start = has_start ? Pose(prior.aRb.value_or(rigid.aRb), *ahead) : seen_start;
  const auto find = [&](const std::vector<Pose> &starts) {
    return estimateRowShear(matches, m_camera, prior, starts, m_options.min_sigma_px);
  };
  const auto matters = [&](const RowShear &row) { return std::abs(row.shear) > std::max(kLean, kSigmas * row.sigma); };
  RowShear found = find({start});
  if (has_start && matters(found)) // a start far off may end in a motion that explains less without a shear
    found = find({start, seen_start});
  const std::int64_t now_ns = m_seen.back().stamp_ns;
  const bool is_likely = m_sheared_ns && now_ns - *m_sheared_ns < kLasts_ns;
  const bool is_sheared = matters(found) && gainOfShear(found, matches, m_camera, prior, {start, seen_start},
                                                        m_options.min_sigma_px) > (is_likely ? kGain : kFirstGain);
  if (!is_sheared || m_refused == kMostRefused) {
    m_refused = 0;
    if (rigid.hasDirection())
      m_ahead = rigid.direction;
    return;
  }
  ++m_refused;
  m_sheared_ns = now_ns;
  m_fault = fmt::format("sheared: its last row stands {:.0f} px farther {} of its first than in the image before "
                        "(rolling shutter)",
                        std::abs(found.shear) * m_camera.height * m_camera.fx / m_camera.fy,
                        found.shear > 0 ? "right" : "left");
  m_tracker.forgetLast();
  m_seen.pop_back();
}

/// From the widest pairs alone: what the points of a frame err by in common is a smaller part of their rotation.
void PointMotion::learn(const std::vector<RelativeMotion> &motions)
{
  const int widest = m_options.widest();
  const auto step = std::find_if(motions.begin(), motions.end(),
                                 [widest](const RelativeMotion &motion) { return motion.frames_back == widest; });
  if (step == motions.end() || !step->gyro || !step->gyro->complete || !step->estimate.hasRotation() ||
      step->a_ns < m_bias_until_ns)
    return;
  m_bias = refineBias(m_bias, *step->gyro, m_bMc.R * step->estimate.aRb * m_bMc.R.transpose(),
                      m_bMc.R * step->estimate.covariance.topLeftCorner<3, 3>() * m_bMc.R.transpose());
  m_bias_until_ns = step->b_ns;
}
} // namespace bole
