// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One model of motion, against which every sensor is compared.
///
/// Idea: an error-state Kalman filter whose state holds the motion (attitude, place, velocity, turning rate), what the
/// sensors may err by (biases of gyro and accelerometer, the rotation between the odometry's body and ours, the scale
/// of its lengths, an offset of its height that wanders) and the poses of the last frames (stochastic cloning, as the
/// MSCKF has it), so that what is measured between two frames is a measurement of the state. Between frames velocity
/// and rate walk: gyro and accelerometer are measurements as the others are, so that none of them is beyond question.
///
/// One test: all measurements of a frame are compared at once by their squared innovation over its covariance. Where
/// that is too much, what stands alone is left out: the measurement without which the others agree best, by more than
/// its own doubt. The doubt is less for one that did not agree in the mean of the last second. The next frame asks all
/// of them again: no verdict outlasts what speaks for it.
///
/// A sensor is named when it was left out for half of a second; what is wrong with it is read from its measurements.
///
/// Frames: w world (z up), b body now, a body at an earlier frame, o the body as the odometry has it (wRo = wRb bRo).
/// Noise is stated in continuous time: the rate of the frames changes no covariance.
///
/// Laws (each a test): the errors are as large as the covariance says (NEES); constants of the sensors that were put in
/// come back; a spike, a pause, another unit leave the state where it belongs and are believed again once they are
/// over; sensors that agree raise nothing at any rate and at any speed.
///
/// Cost: about 0.2 ms a frame at 10 Hz. Not thread-safe.

#include "motion/accelerometer.h"
#include "motion/point_motion.h"
#include <bole/frame.h>

#include <Eigen/Dense>

#include <array>
#include <deque>
#include <optional>
#include <string>

namespace bole
{
/// What measures something in a frame, each to be believed or not.
enum class Source
{
  gyro,
  accelerometer,
  odometry_turn,
  odometry_step,
  odometry_tilt,
  odometry_height,
  points
};
constexpr std::size_t kSources = 7;
inline bool isOdometry(Source source) { return source >= Source::odometry_turn && source <= Source::odometry_height; }

/// A displacement that no odometry told.
struct FreeStep
{
  Eigen::Vector3d moved = Eigen::Vector3d::Zero(); ///< of the body, in its frame at the beginning, in odometry's units
  double sigma = 0;                                ///< [m]
};

/// What an odometry tells, its constant errors taken out.
struct OdometryStep
{
  std::size_t a = 0; ///< frame from which it is told: the last one whose odometry was believed
  Pose aMb;
  double duration_s = 0;
};

class MotionFilter
{
public:
  /// \param first number of the first frame
  explicit MotionFilter(const Pose &bMc, const GyroOptions &gyro = {}, std::size_t first = 0);

  /// Predicts the motion to \p frame, the next one, and returns it without what can not be: for those who look for
  /// points. Each frame is expected, then processed.
  const Frame &expect(const Frame &frame, Frame &room);
  /// Takes in the frame expected last with what the points alone say (RelativeMotion::points).
  void process(const Frame &frame, const std::vector<RelativeMotion> &motions);

  bool believes(Source source) const { return !m_is_out[static_cast<std::size_t>(source)]; }
  /// \p frame, processed last, without the gyro samples or the pose that is not believed.
  const Frame &believed(const Frame &frame, Frame &room) const;
  /// The odometry to the frame processed last, where its step is believed.
  const std::optional<OdometryStep> &odometryStep() const { return m_step; }
  /// Where the odometry puts the frame processed last, less the offset of its height: of use are roll, pitch and
  /// height, as far as believed.
  std::optional<Pose> odometryPose(const Frame &frame) const;
  /// The step to the frame expected or processed last by what was known before it and the accelerometer.
  const std::optional<FreeStep> &freeStep() const { return m_free_step; }
  GyroBias gyroBias() const;
  const std::vector<SensorVerdict> &verdicts() const { return m_verdicts; }

  // For tests and reports.
  Pose pose() const { return {m_wRb, m_place}; }
  const Eigen::Vector3d &velocity() const { return m_velocity; }
  double logScale() const { return m_log_scale; }
  double logScaleSigma() const;
  /// The scale of the odometry without what was expected of it; nothing where little was learnt.
  std::optional<LogScale> measuredScale() const;
  const Eigen::Matrix3d &mount() const { return m_bRo; }                                ///< bRo
  Eigen::MatrixXd motionCovariance() const { return m_covariance.topLeftCorner(9, 9); } ///< attitude, place, velocity

private:
  struct Clone ///< of the pose at an earlier frame
  {
    std::size_t number = 0;
    std::int64_t stamp_ns = 0;
    Eigen::Matrix3d wRb;
    Eigen::Vector3d place;
    std::optional<Pose> odometry;
    bool is_odometry_believed = false;
  };
  struct Rows ///< of one source
  {
    Source source;
    Eigen::MatrixXd H, noise;
    Eigen::VectorXd residual;
  };
  struct Inertial ///< preintegrated from the last frame, in the body there
  {
    bool has_turn = false, has_force = false;
    GyroRotation turn;
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();                                      ///< at the end
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero(), moved = Eigen::Vector3d::Zero(); ///< without gravity
    double longer = 1; ///< how much longer a sample stands for than one of 200 Hz
  };
  struct Judged
  {
    std::array<bool, kSources> is_out{};
    std::array<double, kSources> misfit{}; ///< squared, given what is believed, a row; < 0: not measured
  };

  void begin(const Frame &frame);
  void predict(double dt);
  void collect(const Frame &frame);
  Inertial integrate(const Frame &frame, double dt) const;
  std::optional<FreeStep> stepFrom(const Inertial &inertial, double dt) const;
  std::vector<Rows> measure(const Frame &frame);
  void addInertial(std::vector<Rows> &rows) const;
  void addOdometry(const Frame &frame, std::vector<Rows> &rows);
  Rows stepSince(const Clone &a, const Frame &frame) const;
  Rows turnSince(const Clone &a, const Frame &frame) const;
  void addPoints(const RelativeMotion &motion, std::vector<Rows> &rows) const;
  const Clone *anchorFor(const Frame &frame) const;
  Rows rowsFor(Source source, Eigen::Index count) const;
  Eigen::Index columnOf(const Clone &clone) const;
  Judged judge(const std::vector<Rows> &rows) const;
  double doubtOf(Source source, Eigen::Index rows) const;
  double meanMisfit(Source source) const;
  bool isTie(const std::vector<Rows> &rows, Source a, Source b) const;
  void update(const std::vector<Rows> &rows);
  void remember(const Frame &frame);
  void climbAsFiltered(OdometryStep &step) const;
  Judged judgeOrSwerve();
  void leaveOutHeld(const Frame &frame, const std::vector<RelativeMotion> &motions);
  bool isHeld(const Frame &frame, const std::vector<RelativeMotion> &motions) const;
  void name(const Frame &frame);
  void nameSilence(const Frame &frame);
  void raise(Source source, const std::string &kind, double since_s, const std::string &text);

  Pose m_bMc;
  GyroOptions m_gyro;
  bool m_has_begun = false;
  std::size_t m_number = 0; ///< of the frame expected
  std::int64_t m_stamp_ns = 0;
  double m_usual_dt = 0.1, m_dt = 0.1;
  std::optional<GyroSample> m_last_sample; ///< before the frame expected
  std::optional<Eigen::Vector3d> m_first_force;
  bool m_force_varies = false;
  Inertial m_inertial;
  std::vector<Rows> m_rows; ///< of the frame expected
  std::optional<FreeStep> m_free_step;
  std::optional<OdometryStep> m_step;

  Eigen::Matrix3d m_wRb = Eigen::Matrix3d::Identity(), m_bRo = Eigen::Matrix3d::Identity();
  Eigen::Vector3d m_place = Eigen::Vector3d::Zero(), m_velocity = Eigen::Vector3d::Zero(),
                  m_rate = Eigen::Vector3d::Zero(), m_gyro_bias = Eigen::Vector3d::Zero(),
                  m_force_bias = Eigen::Vector3d::Zero(), m_last_velocity = Eigen::Vector3d::Zero();
  double m_log_scale = 0, m_height = 0;
  std::deque<Clone> m_clones; ///< oldest first
  Eigen::MatrixXd m_covariance;

  std::array<bool, kSources> m_is_out{};
  std::array<double, kSources> m_misfit{}, m_out{}; ///< means of the last second: misfit a row, share left out
  std::array<std::optional<std::int64_t>, kSources> m_since_ns; ///< left out
  std::array<bool, kSources> m_is_named{};
  std::optional<std::int64_t> m_last_gyro_ns, m_last_odometry_ns;
  bool m_is_gyro_silent = false, m_is_odometry_silent = false;
  bool m_is_held = false; ///< the odometry's last pose once more, while the body moved
  int m_same_rates = 0;   ///< frames whose samples all had the same rate
  int m_jumps = 0;
  std::vector<SensorVerdict> m_verdicts;
};
} // namespace bole
