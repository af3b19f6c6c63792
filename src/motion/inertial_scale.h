// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The scale of an odometry from the accelerometer.
///
/// Idea: an odometry whose lengths are off by a factor is off by the same factor in its accelerations, and an
/// accelerometer measures these in metres. So gyro and accelerometer are integrated from window to window (a quarter of
/// a second), and the displacement is compared with that of the odometry, and its direction with that of the points.
/// The comparison is an extended Kalman filter whose states are the attitude, the velocity, the displacement since the
/// window began, both biases and the logarithm of the scale, as in visual-inertial odometry (Forster et al., 2017, for
/// the model of the noise).
///
/// Only the horizontal displacement has the scale: the height of a pose filter comes from a sonar or a barometer.
///
/// While the odometry is silent the filter goes on by gyro, accelerometer and points, and between() stands in for it.
///
/// Frames: b the body, w the world of the odometry up to a rotation about z.
///
/// Laws (each a test): a flight with exact sensors gives the scale of its odometry; a flight at constant velocity
/// leaves it unknown, and the standard deviation says so; an accelerometer that repeats one value is not believed; one
/// whose bias changes in flight tells no wrong scale; over
/// two seconds without odometry the displacement is within three standard deviations.
///
/// Cost: 0.1 ms a frame with 20 samples. Not thread-safe.

#include "motion/accelerometer.h"
#include "motion/gyro.h"
#include "motion/point_motion.h"

#include <optional>

namespace bole
{
/// A displacement by gyro and accelerometer.
struct InertialStep
{
  Eigen::Vector3d moved =
      Eigen::Vector3d::Zero(); ///< of the body, in its frame at the beginning, in the odometry's units
  double sigma = 0;            ///< [m]
};

class InertialScale
{
public:
  /// \param start_sigma of the log of the scale before anything was measured
  explicit InertialScale(const Pose &bMc, const GyroOptions &gyro = {}, double start_sigma = 0.1);

  /// Takes in the next frame and what the points say of it. A frame without samples of the accelerometer begins anew.
  void process(const Frame &frame, const std::vector<RelativeMotion> &motions);

  /// Whether innovations were too large with the frame processed last: the accelerometer has another bias than before,
  /// or is broken.
  bool hasBegunAnew() const { return m_has_begun_anew; }

  /// The scale, an odometry of scale 1 within \p prior_sigma (of the log) being expected: a measurement far outside of
  /// that stands alone. Nothing while no accelerometer was compared, or where points did not tell the direction of a
  /// quarter of the way: by the accelerometer alone a steady curve, whose acceleration a bias may be, has no scale, and
  /// the filter believes that it has.
  std::optional<LogScale> scale(double prior_sigma) const;

  /// The displacement from \p from_ns, which is no earlier than the last comparison, to \p frame, which is yet to be
  /// processed. Nothing while the velocity is unknown.
  std::optional<InertialStep> stepTo(const Frame &frame, std::int64_t from_ns) const;

private:
  static constexpr int kStates = 16;
  struct Anchor ///< where the window begins
  {
    std::int64_t stamp_ns = 0;
    std::size_t index = 0;
    std::optional<Pose> wMb; ///< by the odometry
  };

  bool collect(const Frame &frame);
  void restart(const Frame &frame);
  void begin(const Frame &frame);
  void beginAnew();
  void start(const Frame &frame);
  bool predict(std::int64_t to_ns);
  void propagate(const Eigen::Vector3d &rate, const Eigen::Vector3d &force, double dt);
  void compareTilt(const Pose &wMb);
  void compareOdometry(const Pose &wMb, double duration);
  void comparePoints(const RelativePoseEstimate &points, double duration);
  void update(const Eigen::MatrixXd &H, const Eigen::VectorXd &residual, const Eigen::MatrixXd &noise);

  Pose m_bMc;
  GyroOptions m_gyro;
  double m_start_sigma;
  std::vector<GyroSample> m_samples; ///< since the anchor, one before it where there is one
  std::optional<Eigen::Vector3d> m_first_force;
  bool m_force_varies = false;
  std::optional<Anchor> m_anchor;
  bool m_started = false; ///< the velocity is known
  double m_misfit = 1;    ///< mean of the last squared innovations over their variances
  bool m_has_begun_anew = false;
  int m_compared = 0;   ///< windows
  int m_directions = 0; ///< windows in which points told where it went

  Eigen::Matrix3d m_wRb = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d m_turned = Eigen::Matrix3d::Identity(); ///< since the anchor, by the gyro less its bias
  Eigen::Vector3d m_velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d m_moved = Eigen::Vector3d::Zero(); ///< since the anchor, world
  Eigen::Vector3d m_gyro_bias = Eigen::Vector3d::Zero(), m_force_bias = Eigen::Vector3d::Zero();
  double m_log_scale = 0;
  Eigen::MatrixXd m_covariance = Eigen::MatrixXd::Zero(kStates, kStates); ///< dynamic: compiles faster
};
} // namespace bole
