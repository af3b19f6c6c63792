// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/flight_sensors.h"

#include "support/units.h"

#include <algorithm>
#include <cmath>

namespace bole
{
SimulatedImu::SimulatedImu(const SensorOptions &options)
    : m_options(options),
      m_random(options.seed, 401),
      m_gyro_bias(m_random.normal3(options.gyro_bias)),
      m_accelerometer_bias(Random(options.seed, 403).normal3(options.accelerometer_bias))
{
}

GyroSample SimulatedImu::measure(std::int64_t stamp_ns, const Eigen::Matrix3d &wRb, const Eigen::Vector3d &rate,
                                 const Eigen::Vector3d &acceleration)
{
  const Eigen::Vector3d gyro = rate + m_gyro_bias + m_random.normal3(m_options.gyro_noise);
  const Eigen::Vector3d force = wRb.transpose() * (acceleration + Eigen::Vector3d(0, 0, 9.81)) + m_accelerometer_bias +
                                m_random.normal3(m_options.accelerometer_noise);
  return {stamp_ns, gyro, force};
}

PoseFilter::PoseFilter(const SensorOptions &options)
    : m_options(options), m_random(options.seed, 402), m_scale(1 + options.odometry_scale * m_random.normal())
{
}

Pose PoseFilter::report(std::int64_t stamp_ns, const Pose &wMb)
{
  constexpr double kUnit_ns = 1e8; // of the walks
  const double longer = std::sqrt(std::max(0.0, static_cast<double>(stamp_ns - m_last_ns) / kUnit_ns));
  const Eigen::Vector3d step_noise = longer * m_random.normal3(m_options.odometry_step_noise);
  const double walk = longer * m_options.yaw_walk * m_random.normal();
  const double height_noise = m_options.height_noise * m_random.normal();
  const Eigen::Vector3d attitude_noise = m_random.normal3(m_options.attitude_noise);
  if (!m_started) {
    m_position = wMb.t;
  }
  else {
    const Eigen::Matrix3d drift = expSo3({0, 0, m_yaw_error});
    m_position += drift * (m_scale * (wMb.t - m_last_truth) + step_noise);
    m_yaw_error += walk;
  }
  m_position.z() = wMb.t.z() + (m_started ? height_noise : 0);
  m_last_truth = wMb.t;
  m_last_ns = stamp_ns;
  m_started = true;
  return {expSo3({0, 0, m_yaw_error}) * wMb.R * expSo3(attitude_noise), m_position};
}
} // namespace bole
