// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A flight from side to side that is made up: ten frames and 200 samples of gyro and accelerometer a second, an
/// odometry with a scale, and what points would say.

#include "geometry/constants.h"
#include "motion/point_motion.h"

#include <bole/open_source.h>

#include <cmath>
#include <functional>
#include <random>

namespace bole::test
{
struct MadeFlight
{
  double frame_rate = 10;    ///< [Hz], 5 to 60
  double sway = 1.2;         ///< amplitude of the path from side to side [m]
  double radius = 0;         ///< of the circle that is flown instead at 1 m/s [m]; 0: none
  double factor = 1;         ///< of the odometry's horizontal lengths
  double odometry_noise = 0; ///< horizontal, a frame [m]
  double force_noise = 0;    ///< a sample [m/s^2]
  Eigen::Vector3d force_bias = Eigen::Vector3d::Zero();
  double points_noise = 0; ///< of the points' direction [rad], as stated
  double points_turn = 0;  ///< error of the points' rotation about the camera's vertical [rad]
  double points_slip = 0;  ///< and of their direction of translation, sideways, for each radian of that
  bool has_constant_force = false;
  std::mt19937 random{1};
  Eigen::Vector3d walked = Eigen::Vector3d::Zero(); ///< of the odometry from the truth

  static Pose truth(double t, double sway)
  {
    const double w = 2 * M_PI / 6, lead = 0.3 * std::sin(0.9 * t);
    return {expSo3({0, 0, lead}) * expSo3({0.1 * std::sin(1.3 * t), 0.05 * std::cos(t), 0}),
            {t, sway * std::sin(w * t), 1.2 + 0.1 * std::sin(0.7 * t)}};
  }
  Pose truth(double t) const
  {
    if (radius <= 0)
      return truth(t, sway);
    const double turned = t / radius;
    return {expSo3({0, 0, turned}) * expSo3({0.03 * std::sin(2.6 * t), 0.03 * std::cos(2.1 * t), 0}),
            {radius * std::sin(turned), radius * (1 - std::cos(turned)),
             1.2 + 0.1 * std::sin(0.7 * t) + 0.06 * std::sin(1.9 * t)}};
  }

  Eigen::Vector3d white()
  {
    std::normal_distribution<double> normal;
    return {normal(random), normal(random), normal(random)};
  }

  GyroSample sample(double t)
  {
    constexpr double h = 1e-3;
    const Eigen::Vector3d rate = logSo3(truth(t - h).R.transpose() * truth(t + h).R) / (2 * h);
    const Eigen::Vector3d acceleration = (truth(t + h).t - 2 * truth(t).t + truth(t - h).t) / (h * h);
    Eigen::Vector3d force = truth(t).R.transpose() * (acceleration + Eigen::Vector3d(0, 0, 9.81)) + force_bias;
    force += force_noise * white();
    return {nsOf(t), rate, has_constant_force ? Eigen::Vector3d(0, 0, 9.81) : force};
  }

  /// To be asked for in the order of time.
  Frame frame(std::size_t index)
  {
    const double t = static_cast<double>(index) / frame_rate;
    const int samples = static_cast<int>(std::lround(200 / frame_rate));
    Frame frame;
    frame.index = index;
    frame.stamp_ns = nsOf(t);
    walked += odometry_noise * white().cwiseProduct(Eigen::Vector3d(1, 1, 0));
    frame.wMb_odometry = truth(t);
    frame.wMb_odometry->t.head<2>() *= factor;
    frame.wMb_odometry->t += walked;
    for (int k = 1; k <= samples && index > 0; ++k)
      frame.gyro.push_back(sample(t - 0.005 * (samples - k)));
    return frame;
  }

  /// What points say of the motion since 0.3 s before.
  std::vector<RelativeMotion> seen(std::size_t index)
  {
    const auto back = static_cast<std::size_t>(std::lround(0.3 * frame_rate));
    if (index < back)
      return {};
    const Pose bMc = forwardCamera();
    const double to = static_cast<double>(index) / frame_rate, from = static_cast<double>(index - back) / frame_rate;
    const Pose aMb = (truth(from) * bMc).inverse() * (truth(to) * bMc);
    RelativeMotion motion;
    motion.frames_back = static_cast<int>(back);
    motion.a_index = index - back;
    motion.b_index = index;
    motion.a_ns = nsOf(from);
    motion.b_ns = nsOf(to);
    motion.points.status = RelativePoseStatus::ok;
    motion.points.aRb = aMb.R;
    motion.points.direction = aMb.t.normalized();
    motion.points.parallax_px = 3;
    motion.points.covariance = 1e-4 * Matrix5d::Identity();
    motion.points.covariance.topLeftCorner<3, 3>() *= 1e-2;
    if (points_noise > 0) {
      const Eigen::Matrix<double, 3, 2> basis = directionBasis(motion.points.direction);
      motion.points.direction = (motion.points.direction + basis * points_noise * white().head<2>()).normalized();
      motion.points.covariance.bottomRightCorner<2, 2>() = points_noise * points_noise * Eigen::Matrix2d::Identity();
    }
    if (points_turn > 0)
      confuse(motion.points);
    return {motion};
  }

  /// Takes some rotation for a translation, and says so.
  void confuse(RelativePoseEstimate &points)
  {
    const Eigen::Vector3d turn = white().x() * points_turn * Eigen::Vector3d::UnitY();
    Vector5d together = Vector5d::Zero();
    together.head<3>() = Eigen::Vector3d::UnitY();
    const Eigen::Matrix<double, 3, 2> basis = directionBasis(points.direction);
    together.tail<2>() = points_slip * basis.transpose() * Eigen::Vector3d::UnitX();
    points.direction =
        (points.direction + points_slip * turn.y() * basis * (basis.transpose() * Eigen::Vector3d::UnitX()))
            .normalized();
    points.aRb = points.aRb * expSo3(turn);
    points.covariance = points_turn * points_turn * together * together.transpose();
    points.covariance += 1e-6 * Matrix5d::Identity();
  }
};

/// Odometry and accelerometer are as noisy as those of a small drone.
inline MadeFlight noisyFlight()
{
  MadeFlight flight;
  flight.odometry_noise = 0.012;
  flight.force_noise = 0.1;
  return flight;
}

using Damage = std::function<void(Frame &)>;

/// Changes each rate of the gyro.
inline Damage rates(const std::function<void(Eigen::Vector3d &)> &change)
{
  return [change](Frame &frame) {
    for (GyroSample &sample : frame.gyro)
      change(sample.rate);
  };
}

constexpr double kBegins_s = 5; ///< damage that is late

inline bool isLate(const Frame &frame) { return frame.stamp_ns >= nsOf(kBegins_s); }

inline Damage late(const Damage &damage)
{
  return [damage](Frame &frame) {
    if (isLate(frame))
      damage(frame);
  };
}
} // namespace bole::test
