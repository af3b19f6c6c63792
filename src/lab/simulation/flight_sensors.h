// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the drone's own sensors would say: gyro, accelerometer, and the drifting pose filter on board.

#include "simulation/random.h"
#include <bole/frame.h>

namespace bole
{
/// Noise of a small drone's sensors; the defaults are those of the recorded sequences this project is developed on.
struct SensorOptions
{
  std::uint64_t seed = 1;
  double gyro_noise = 0.01;           ///< standard deviation a sample [rad/s], 0 to 1
  double gyro_bias = 0.006;           ///< standard deviation of the constant bias an axis [rad/s], 0 to 1
  double accelerometer_noise = 0.1;   ///< standard deviation a sample [m/s^2], 0 to 10
  double accelerometer_bias = 0.05;   ///< standard deviation of the constant bias an axis [m/s^2], 0 to 10
  double odometry_step_noise = 0.012; ///< of the horizontal way in 0.1 s, an axis [m], 0 to 1; it walks: as the root
                                      ///< of the time
  double odometry_scale = 0.02;       ///< standard deviation of the scale error, 0 to 0.5
  double height_noise = 0.019;        ///< of the height in one frame [m], 0 to 1
  double attitude_noise = 0.004;      ///< of roll, pitch and yaw in one frame [rad], 0 to 0.5
  double yaw_walk = 0.003;            ///< of the heading's drift in 0.1 s [rad], 0 to 0.5; it walks
};

class SimulatedImu
{
public:
  explicit SimulatedImu(const SensorOptions &options);
  /// \param rate angular rate in the body frame [rad/s]; \param acceleration of the body in the world [m/s^2].
  GyroSample measure(std::int64_t stamp_ns, const Eigen::Matrix3d &wRb, const Eigen::Vector3d &rate,
                     const Eigen::Vector3d &acceleration);

private:
  SensorOptions m_options;
  Random m_random;
  Eigen::Vector3d m_gyro_bias, m_accelerometer_bias;
};

/// The pose filter: dead reckoning in the plane with scale error, step noise and a drifting
/// heading; height (sonar) and roll and pitch (gravity) noisy but without drift.
class PoseFilter
{
public:
  explicit PoseFilter(const SensorOptions &options);
  /// Pose that the filter reports for the next frame; the first report is at the true position.
  Pose report(std::int64_t stamp_ns, const Pose &wMb);

private:
  SensorOptions m_options;
  Random m_random;
  double m_scale;
  double m_yaw_error = 0;
  bool m_started = false;
  std::int64_t m_last_ns = 0;
  Eigen::Vector3d m_last_truth = Eigen::Vector3d::Zero(), m_position = Eigen::Vector3d::Zero();
};
} // namespace bole
