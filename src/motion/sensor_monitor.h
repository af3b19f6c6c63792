// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Which sensor contradicts the others: gyro, odometry, images, accelerometer.
///
/// Idea: gyro, odometry and points each measure the rotation between two frames. Every pair of them is compared by the
/// squared difference over its variance; the sensor that stands in both failing pairs is the one that lies. Further
/// tests need one sensor or two: an odometry that stands still, jumps, scatters, ends, begins far from the ground,
/// leans against gravity or flies askew to the points' direction; an accelerometer whose gravity is not the odometry's;
/// a gyro that repeats its value, loses samples or ends. A pair fails when four of the last six comparisons exceed a
/// limit, so that one false match raises no alarm. Stamps of the images that are off by an error of their own show
/// otherwise: see checkStamps().
///
/// Where the points contradict the gyro, the odometry, too coarse to fail against either, still says which of the two
/// is more likely: its two squared differences are summed over the window.
///
/// A single comparison that fails leaves the sensor that stands alone out of its frame at once: what two others say is
/// taken, and nothing wrong enters the map before the alarm. A turn that gyro and odometry tell so differently that no
/// point would be found where the wrong one puts it is decided before the points are looked for, by how fast the body
/// turned until then. A step of the odometry is judged by the last velocity that was believed: where a pose is off and
/// comes back, neither of its two jumps is a step. A sensor that was silent or repeated itself is trusted again once
/// all of a window agrees with the points.
///
/// False alarms: three rotations of normal errors exceed the limit of 25 once in 60,000 comparisons; four of six do so
/// once in 10^17. What decides in practice are errors that are not normal: see the limits.
///
/// Laws (each a test): sensors that agree raise nothing; each fault is named with its sensor and the time it began; the
/// two sensors that agree are still trusted.
///
/// Cost: 0.1 ms a frame. Not thread-safe.

#include "motion/point_motion.h"
#include <bole/frame.h>

#include <deque>
#include <optional>
#include <string>

namespace bole
{
enum class Sensor
{
  gyro,
  odometry,
  images,
  accelerometer
};
const char *toString(Sensor sensor);

class SensorMonitor
{
public:
  explicit SensorMonitor(const Pose &bMc) : m_bMc(bMc) {}

  /// Takes in a frame as its source gave it, with what the points alone say (RelativeMotion::points).
  void process(const Frame &frame, const std::vector<RelativeMotion> &motions);

  /// All that was found so far, in the order of time; a text may become more exact.
  const std::vector<SensorVerdict> &verdicts() const { return m_verdicts; }
  /// False while a lasting verdict stands against a sensor.
  bool trusts(Sensor sensor) const { return !of(sensor).is_distrusted; }
  /// Whether what a sensor says of the motion to the newest frame may be used.
  bool trustsNow(Sensor sensor) const { return trusts(sensor) && !of(sensor).is_wrong_now; }
  /// \p frame, which is yet to be processed, without the sensors whose verdict lasts or whose rotation is implausible:
  /// itself, or a copy in \p scratch.
  const Frame &withoutRejectedSensors(const Frame &frame, Frame &scratch) const;
  /// The frame processed last without its rejected sensors: itself, or a copy in \p scratch.
  const Frame &trusted(const Frame &frame, Frame &scratch) const;

private:
  struct State ///< of a sensor
  {
    bool is_distrusted = false;             ///< by a verdict that lasts
    bool is_wrong_now = false;              ///< in the newest frame
    std::optional<std::size_t> may_recover; ///< number of the verdict that an agreement ends
  };
  struct Comparison ///< of the rotations over one interval
  {
    std::int64_t a_ns = 0, b_ns = 0;
    std::optional<Eigen::Matrix3d> gyro, odometry, points;
    Eigen::Matrix3d points_covariance = Eigen::Matrix3d::Zero();
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();            ///< of flight, by the odometry, in the body
    Eigen::Vector3d askew = Eigen::Vector3d::Zero();                ///< rotation from it to that by the points [rad]
    double askew_variance = 0;                                      ///< 0: no direction
    double gyro_points = 0, gyro_odometry = 0, odometry_points = 0; ///< squared differences over their variances
    Eigen::Vector3d error = Eigen::Vector3d::Zero();                ///< rotation from the gyro's to the points' [rad]
    Eigen::Matrix3d error_covariance = Eigen::Matrix3d::Zero();
    Eigen::Vector3d rate_a = Eigen::Vector3d::Zero(),
                    rate_b = Eigen::Vector3d::Zero(); ///< at both ends, as seen from b [rad/s]
  };
  struct Velocity
  {
    Eigen::Vector3d mean; ///< in the world [m/s]
    std::int64_t until_ns;
    double duration; ///< that it was measured over [s]
  };
  struct Step ///< of the odometry from frame to frame
  {
    std::int64_t stamp_ns = 0;
    Pose wMb;
    std::optional<Velocity> believed;            ///< the last one up to here that is no jump
    std::optional<Eigen::Vector2d> acceleration; ///< to it, horizontal [m/s^2]
    double scatter = 0; ///< squared change of the acceleration over what a filter that walks and a flight explain
    double parallax_px = 0;
    bool is_jump = false;
    bool is_held = false; ///< the pose before once more, while the points moved
  };

  struct Turns ///< from the frame processed last to another one [rad]
  {
    std::optional<Eigen::Vector3d> gyro, odometry;
    double dt = 0; ///< [s]
  };
  Turns turnsTo(const Frame &frame) const;
  std::optional<Sensor> implausibleSensor(const Turns &turns) const;
  void collect(const Frame &frame);
  void compare(const Frame &frame, const RelativeMotion &motion);
  void checkGyroSamples(const Frame &frame);
  void checkLostSamples(std::int64_t now_ns);
  void checkSteps(const Frame &frame, const std::vector<RelativeMotion> &motions);
  void checkHeight(double height, double time_s);
  void raiseJump(double extent, double time_s);
  void checkStandingStill(double time_s);
  void checkScatter();
  void rejectOutvoted(const Frame &frame);
  void checkRotations();
  std::deque<Comparison>::const_iterator windowBegin() const;
  double logOddsOfPoints() const;
  bool hasGyroAgreedInTurns() const;
  void checkRecovery(Sensor sensor);
  void recover(Sensor sensor, double time_s);
  void checkStamps();
  void checkDirection();
  void checkGravity();
  bool isTurnedBy(const Eigen::Vector3d &up) const;
  void diagnoseGyro();
  enum class Lasts
  {
    no,          ///< a moment
    until_agree, ///< until the sensor agrees with the others again
    yes
  };
  void raise(Sensor sensor, const char *kind, double since_s, const std::string &text, Lasts lasts = Lasts::yes);
  State &of(Sensor sensor) { return m_states[static_cast<int>(sensor)]; }
  const State &of(Sensor sensor) const { return m_states[static_cast<int>(sensor)]; }

  static constexpr double kSilence_s = 0.5; ///< without a sample from a sensor that had some

  Pose m_bMc;
  std::vector<GyroSample> m_samples; ///< of the last seconds
  std::deque<Comparison> m_comparisons;
  std::deque<Step> m_steps;
  std::optional<std::int64_t> m_last_ns;               ///< stamp of the frame processed last
  Eigen::Vector3d m_turning = Eigen::Vector3d::Zero(); ///< the body, by what was trusted last [rad/s]
  std::optional<std::int64_t> m_gyro_changed_ns;       ///< when the gyro's value was last another one
  std::int64_t m_last_gyro_ns = 0, m_last_odometry_ns = 0;
  bool m_had_gyro = false, m_had_odometry = false;
  std::vector<SensorVerdict> m_verdicts;
  State m_states[4];
};
} // namespace bole
