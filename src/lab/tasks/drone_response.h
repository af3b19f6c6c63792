// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a drone is believed to do with the velocities it is sent.
///
/// Idea: a frame is old when it arrives, a command is late when it acts, and the drone takes its time to obey. What was
/// sent and has not shown yet is known, so a control law need not order it twice. The turn is a delay and a first-order
/// lag; a velocity is a delay and two lags, since a drone that holds a velocity by tilting must tilt first. What is
/// wrong with that (drag, wind) is for a FeatureFilter to find.

#include <Eigen/Core>

#include <deque>
#include <utility>

namespace bole
{
struct ResponseOptions
{
  double delay = 0.13;     ///< from the exposure of a frame until what is sent for it acts [s], 0 to 1
  double speed_lag = 0.55; ///< of the horizontal velocity and the climb, half by each of two lags [s], 0 (at once) to
                           ///< 3: 1 / (velocity loop + drag), as tilts of .16 s and a loop of 1.65/s give it
  double turn_lag = 0.2;   ///< of the rate of turn [s], 0 to 3
};

/// Law (a test): the path of a constant velocity v tends to v (t - delay - lag).
class DroneResponse
{
public:
  explicit DroneResponse(const ResponseOptions &options = {});

  /// Of the body: vx, vy, vz [m/s], wz [rad/s], sent for the frame of \p frame_time_s [s]; times rise.
  void send(double frame_time_s, const Eigen::Vector4d &velocity);
  /// To \p time_s; the path since the time before: integral of velocity() [m, rad].
  Eigen::Vector4d advance(double time_s);
  const Eigen::Vector4d &velocity() const { return m_velocity; } ///< obeyed so far
  /// The path on which it would come to rest if from now on it obeyed zero.
  Eigen::Vector4d coast() const;
  double time() const { return m_time_s; }
  const ResponseOptions &options() const { return m_options; }

private:
  double lagOf(int axis) const;

  ResponseOptions m_options;
  std::deque<std::pair<double, Eigen::Vector4d>> m_sent; ///< by the time they act; the first may act already
  Eigen::Vector4d m_velocity = Eigen::Vector4d::Zero(), m_push = Eigen::Vector4d::Zero(); ///< behind both lags, one
  double m_time_s = 0;
  bool m_has_time = false;
};
} // namespace bole
