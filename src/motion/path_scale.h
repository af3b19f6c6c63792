// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The scale of a path from gyro and accelerometer.
///
/// Idea: a path whose lengths are off by a factor is off by the same factor in its accelerations, and an accelerometer
/// measures these in metres. The path is the one that the smoother holds now, trunks and points being in it: it is good
/// to a centimetre where the odometry has walked away by ten. Since old poses become better with every new view, the
/// whole of the last minute is compared anew. For a given scale that is a Kalman filter over one preintegrated
/// step a frame (Forster et al., 2017) whose states are attitude, velocity and place on the path and both biases, and
/// the weighted squares of its innovations tell that scale from others. As a state of the filter the scale would take
/// the noise of the accelerometer for a motion that the path has not: a steady flight gave a path 0.7 of its length. So
/// would the whole log-likelihood, whose determinant is least for a short path: it stands for accelerations that were
/// drawn independently of what was measured. What is fitted is a line between two quantities that both err, and the
/// squares alone have their minimum at its slope (Deming regression).
///
/// The attitude comes from the gyro and from the roll and pitch of the pose filter, not from the path: where points
/// take a translation for a rotation, the roll and pitch of the path follow the accelerations, and gravity through
/// these gave a scale 5 % off.
///
/// Only horizontal lengths have the scale: the height of a pose filter comes from a sonar or a barometer.
///
/// Frames: b the body, w the world of the path.
///
/// Laws (each a test): an exact path gives its scale; the path's noise and the biases stay within three standard
/// deviations; a tilt of the path is not believed; a flight at constant velocity leaves the scale unknown, and the
/// standard deviation says so; an accelerometer that repeats one value is not believed.
///
/// Cost: 30 us a frame of the path in measure(). Not thread-safe.

#include "motion/accelerometer.h"
#include "motion/gyro.h"

#include <deque>
#include <functional>

namespace bole
{
class PathScale
{
public:
  using Path = std::function<Pose(std::size_t)>; ///< wMb by the number of the frame

  static constexpr double kWalkAmongTrees = 0.02; ///< of a path that points hold [m/sqrt(s)]

  /// \param walk horizontal, of the errors of the path [m/sqrt(s)]
  explicit PathScale(const GyroOptions &gyro = {}, double walk = kWalkAmongTrees) : m_gyro(gyro), m_walk(walk) {}

  /// Takes in the next frame, the frames being counted from 0. One without samples of the accelerometer begins anew.
  void add(const Frame &frame);

  /// Takes back what the accelerometer said in the \p last_s: from now on its bias may be another one.
  void forget(double last_s);

  /// Logarithm of the length of \p path over the true length, a path of scale 1 within \p prior_sigma being expected:
  /// a measurement far outside of that stands alone. Nothing without an accelerometer.
  std::optional<LogScale> measure(const Path &path, double prior_sigma);

private:
  struct Step ///< from the frame before, by gyro and accelerometer, in the body there
  {
    bool is_known = false;     ///< samples covered it
    bool is_bias_open = false; ///< what was known of the bias before does not hold
    std::size_t frame = 0;     ///< its end
    double duration = 0;       ///< [s]
    double longer = 1;         ///< how much longer a sample stands for than one of 200 Hz
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero(), moved = Eigen::Vector3d::Zero(); ///< without gravity
    std::optional<Eigen::Vector3d> up; ///< at its end, in the body there, by the pose filter
  };
  struct Peak ///< of the likelihood, or of likelihood and prior
  {
    double log_scale = 0, log_likelihood = 0, information = 0;
    double alone = 0; ///< where the parabola about it has its own peak, without the prior
  };
  class Filter;

  Step stepTo(const Frame &frame);
  std::optional<Peak> findPeak(const std::vector<Pose> &path, double from, double prior) const;
  std::optional<double> logLikelihood(const std::vector<Pose> &path, double log_scale) const;

  GyroOptions m_gyro;
  double m_walk;
  std::deque<Step> m_steps;
  std::optional<GyroSample> m_last; ///< sample
  std::optional<Eigen::Vector3d> m_first_force;
  bool m_force_varies = false;
  std::size_t m_frames = 0;
  std::int64_t m_stamp_ns = 0;
  double m_log_scale = 0; ///< as measured last: the next search begins there
};
} // namespace bole
