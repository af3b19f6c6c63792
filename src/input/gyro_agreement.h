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
/// translation; the translation of a flight adds a shift that changes slowly and is taken out as the median. What is
/// left has a likelihood for the images as they are, for images that are late or early by up to six frames, mirrored,
/// and upside down; no interval counts for more than a wrong match of the images would. Another hypothesis is believed
/// when it is far likelier and the camera rotated enough to tell. Its scale is how well the flight has shown that its
/// images agree with its gyro: then the last four intervals may suffice. Before that it takes eight.
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
  /// Median of the differences, and of their squared distances from it [rad^2].
  struct Usual
  {
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    double variance = 0;
    bool is_of_flight = false; ///< it was shown by the flight
  };
  static const std::vector<Hypothesis> &hypotheses();
  static Usual usualOf(const std::vector<Eigen::Vector2d> &differences);
  std::optional<Usual> usual() const;
  std::vector<Eigen::Vector2d> differences(const Hypothesis &hypothesis, int count, int back, bool is_odometry) const;
  double misfit(const Hypothesis &hypothesis, const Usual &usual, int count, int back, bool is_odometry) const;
  double variance() const;
  bool hasJumped() const;
  Verdict judge();

  std::deque<Interval> m_intervals;
  std::deque<Eigen::Vector2d> m_agreed; ///< differences of intervals that agreed [rad]
  int m_lag = 0;
  Verdict m_held = Verdict::agrees;
};
} // namespace bole
