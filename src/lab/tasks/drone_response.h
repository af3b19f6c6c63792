// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a drone is believed to do with the velocities it is sent.
///
/// Idea: a frame is old when it arrives, a command is late when it acts, and the drone takes its time to obey. What was
/// sent and has not shown yet is known, so a control law need not order it twice. The turn is a delay and a first-order
/// lag; a velocity is a delay and two lags, since a drone that holds a velocity by tilting must tilt first. What is
/// wrong with that (drag, wind) is for a FeatureFilter to find.

#include <bole/pose.h>

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

/// Where a drone in a plane is going to be by what it has been sent.
///
/// Idea: a drone that is slow to obey coasts. The place where it would come to rest by itself moves at once by what is
/// sent, so a way planned from there needs to know nothing more of the lag. By how much the drone obeys (drag against
/// its velocity loop) shows over seconds in what it flew.
///
/// Law (a test): sent u / obeyed() along a straight line, a drone that obeys by a share flies at u.
class PlaneResponse
{
public:
  explicit PlaneResponse(const ResponseOptions &options = {}) : m_response(options) {}

  /// The frame of \p time_s [s] puts the drone at \p place [m].
  void see(const Eigen::Vector2d &place, double time_s);
  /// \p velocity [m/s] in the axes of the places, sent for the frame seen last.
  void send(const Eigen::Vector2d &velocity);
  Eigen::Vector2d rest() const { return m_rest; } ///< where it would come to rest
  double obeyed() const;                          ///< share of what is sent that is flown

private:
  DroneResponse m_response;
  Eigen::Vector2d m_place = Eigen::Vector2d::Zero(), m_rest = Eigen::Vector2d::Zero();
  double m_time_s = 0, m_flown = 0, m_sent = 0; ///< last seconds: [m^2], [m^2]
  bool m_has_place = false;
};

/// A visual feature that moves as the drone was told to, and drifts besides.
///
/// Idea: a Kalman filter on (value, drift). The value moves by what the drone is believed to have done (interaction
/// matrix times path) and by a drift that is learnt from the images: the target's own motion, wind, and whatever the
/// drone does not obey. The drift is the estimate of de/dt that visual servoing feeds forward to leave no lag.
///
/// Law (a test): of a feature that drifts at a constant rate, value and rate are found without bias.
class FeatureFilter
{
public:
  /// \param seen first value, with the standard deviation \p sigma; \p drift_sigma of the unknown drift [1/s].
  void start(double seen, double sigma, double drift_sigma);
  /// \p moved by what the drone did in \p dt [s]; \p unrest: how fast the drift changes [1/s per root of a second].
  void predict(double moved, double dt, double unrest);
  /// What is farther off than three standard deviations moves it by no more than these: read from other edges.
  void correct(double seen, double sigma);
  /// The drift of the last interval as it was measured otherwise [1/s].
  void correctDrift(double seen, double sigma);

  double value() const { return m_x(0); }
  double drift() const { return m_x(1); } ///< [1/s]

private:
  Eigen::Vector2d m_x = Eigen::Vector2d::Zero();
  Eigen::Matrix2d m_P = Eigen::Matrix2d::Zero();
};
} // namespace bole
