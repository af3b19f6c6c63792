// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether the images move as the gyro says.

#include <Eigen/Core>

#include <deque>
#include <optional>
#include <vector>

namespace bole
{
/// Compares the shift of whole images with the rotation of the camera over about a second.
///
/// Idea: between two frames the distant part of a scene moves by the rotation alone, by f w, whatever the camera's
/// translation; the translation of a flight adds a shift that changes slowly and is taken out as the median. The
/// sum of squared differences is formed for the images as they are, for images that are late or early by up to six
/// frames, mirrored, and upside down. Another hypothesis is believed when its sum is several times smaller and the
/// camera rotated enough to tell. Where the flight has shown how well its images agree with its gyro, the last four
/// intervals may suffice: each hypothesis has a likelihood, and no interval counts for more than a wrong match of the
/// images would.
class GyroAgreement
{
public:
  struct Interval
  {
    Eigen::Vector2d image = Eigen::Vector2d::Zero(); ///< shift of the image over the focal length [rad]
    Eigen::Vector2d gyro = Eigen::Vector2d::Zero();  ///< what the gyro says it should be [rad]
    std::optional<Eigen::Vector2d> odometry;         ///< what the odometry says it should be [rad]
    bool is_sure = true;                             ///< both images show the same place without doubt
    bool is_seen = true;                             ///< the shift is one that images are searched for
  };
  enum class Verdict
  {
    agrees,
    jumped, ///< the last interval alone disagrees, and by far
    late,   ///< or early: see lag()
    mirrored,
    upside_down
  };
  /// \param is_usual whether the image may be one of those that tell how well images and gyro agree
  Verdict add(const Interval &interval, bool is_usual = true);
  /// Frames by which the images are late (negative: early).
  int lag() const { return m_lag; }
  /// The sequence is broken; how well images and gyro agree is remembered.
  void reset();
  /// Median of image less gyro over the intervals that agreed [rad]; 0 while there are too few.
  Eigen::Vector2d usualOffset() const;
  /// Whether a shift over some \p frames is what the gyro says, as well as those of the flight are.
  bool follows(const Eigen::Vector2d &image, const Eigen::Vector2d &gyro, int frames) const;

private:
  struct Hypothesis
  {
    Verdict verdict = Verdict::agrees;
    int lag = 0;
    double x = 1, y = 1; ///< signs of the shift
  };
  /// Median of the differences that the flight has shown, and of their squared distances from it [rad^2].
  struct Usual
  {
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    double variance = 0;
  };
  static const std::vector<Hypothesis> &hypotheses();
  std::optional<Usual> usual() const;
  double clippedSum(const Hypothesis &hypothesis, const Usual &usual, int count, bool is_odometry) const;
  Verdict judgeSuffix();
  double cost(int lag, double sign_x, double sign_y, bool is_odometry) const;
  double variance() const;
  bool hasJumped() const;
  Verdict judgeWindow();

  std::deque<Interval> m_intervals;
  std::deque<Eigen::Vector2d> m_agreed; ///< differences of intervals that agreed [rad]
  int m_lag = 0;
  bool m_is_late = false;
  Verdict m_suspected = Verdict::agrees, m_held = Verdict::agrees;
  int m_suspected_lag = 0;
  int m_same = 0;
};
} // namespace bole
