// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The stage: from each frame to the relative rotation and direction of motion since earlier
/// frames.
///
/// Idea: PointTracker follows corners, integrateGyro() says what to expect, estimateRelativePose() joins the two: the
/// pose filter is the smoother's, and must not count twice. The rotation it finds gives the gyro's bias back, so
/// that after a few frames the gyro alone is several times better than at the start, also on frames
/// without a single point.
///
/// Every missing part is allowed: no gyro, no odometry (a plain video), no points (a white wall);
/// the status of each RelativePoseEstimate says what it rests on.
///
/// \code
/// PointMotion motion(source.camera(), source.bMc());
/// while (source.next(frame)) {
///   for (const RelativeMotion &step : motion.process(frame)) {
///     if (step.estimate.hasDirection()) { ... step.frames_back, step.estimate.aRb,
///     step.estimate.direction ... }
///   }
/// }
/// \endcode

#include "motion/gyro.h"
#include "motion/relative_pose.h"

#include <algorithm>
#include <deque>
#include <string>

namespace bole
{
struct PointMotionOptions
{
  double min_sigma_px = kMatchSigma_px; ///< floor of the noise of a match, > 0
  GyroOptions gyro;
  std::vector<int> frames_back{1, 3}; ///< each 1 to PointTracker::kHistory - 1
  int widest() const { return *std::max_element(frames_back.begin(), frames_back.end()); }
  int every = 1; ///< good frames from one whose motions are told to the next, 1 to 20: those of frames between are no
                 ///< news, as the same errors of the same points are in them
};

/// Motion of the camera from frame a (\p frames_back before) to the current frame b.
struct RelativeMotion
{
  int frames_back = 1; ///< counted in frames that were processed
  std::int64_t a_ns = 0, b_ns = 0;
  std::size_t a_index = 0, b_index = 0; ///< numbers of the two frames, as they came: 0, 1, ...
  RelativePoseEstimate estimate;
  /// By the points alone: neither gyro nor odometry is in it, so it can judge both. Only for the longest of the
  /// options' frames_back, else too_few_points.
  RelativePoseEstimate points;
  std::optional<GyroRotation> gyro; ///< of the body, the prior that was used
};

class PointMotion
{
public:
  PointMotion(const PinholeCamera &camera, const Pose &bMc, const PointMotionOptions &options = {});

  /// One RelativeMotion for each entry of frames_back that the video reaches, in every so many frames. Frames that
  /// are not ok, and those that fault() names, are passed over: the next one is tracked from the last good one.
  std::vector<RelativeMotion> process(const Frame &frame);
  /// Learns the bias of the gyro from the last result of process(), once nothing speaks against it.
  void learn(const std::vector<RelativeMotion> &motions);

  /// Follows the points alone, where nobody asks for a motion.
  void track(const Frame &frame);

  /// What is wrong with the image of the frame processed last, by its points; empty where nothing is.
  const std::string &fault() const { return m_fault; }

  const PointTracker &tracker() const { return m_tracker; }
  /// How many good frames back it remembers, and the number of the one \p back good frames before the current one.
  int framesBack() const { return static_cast<int>(m_seen.size()) - 1; }
  std::size_t frameIndex(int back) const { return (m_seen.rbegin() + back)->index; }
  const GyroBias &gyroBias() const { return m_bias; }

private:
  struct Seen
  {
    std::int64_t stamp_ns;
    std::size_t index;
    std::optional<Pose> wMb;
  };
  std::optional<GyroRotation> gyroSince(std::int64_t from_ns, std::int64_t to_ns) const;
  RelativePosePrior expect(RelativeMotion &step, int frames_back, bool with_odometry) const;
  RelativeMotion relativeTo(int frames_back) const;
  void judgeShear(const std::vector<RelativeMotion> &motions);

  PinholeCamera m_camera;
  Pose m_bMc;
  PointMotionOptions m_options;
  PointTracker m_tracker;
  GyroBias m_bias;
  std::deque<Seen> m_seen;                  ///< oldest first, the current frame last
  std::vector<GyroSample> m_gyro;           ///< since the oldest frame of m_seen
  std::optional<GyroRotation> m_turned;     ///< from the good frame before to the newest
  int m_good_frames = 0;                    ///< that were processed
  std::size_t m_frames = 0;                 ///< that came, good or not
  std::int64_t m_bias_until_ns = 0;         ///< end of the last interval that taught the bias
  std::string m_fault;                      ///< of the newest image
  int m_refused = 0;                        ///< images in a row
  std::optional<std::int64_t> m_sheared_ns; ///< stamp of the last that was
  std::optional<Eigen::Vector3d> m_ahead;   ///< direction of the last translation from frame to frame, camera axes
};
} // namespace bole
