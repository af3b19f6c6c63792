// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether the images move as the gyro says.

#include <Eigen/Core>

#include <deque>
#include <optional>

namespace bole
{
/// Compares the shift of whole images with the rotation of the camera over about a second.
///
/// Idea: between two frames the distant part of a scene moves by the rotation alone, by f w, whatever the camera's
/// translation; the translation of a flight adds a shift that changes slowly and is taken out as the median. The
/// sum of squared differences is formed for the images as they are, for images that are late or early by up to six
/// frames, mirrored, and upside down. Another hypothesis is believed when its sum is several times smaller and the
/// camera rotated enough to tell.
class GyroAgreement
{
public:
  struct Interval
  {
    Eigen::Vector2d image = Eigen::Vector2d::Zero(); ///< shift of the image over the focal length [rad]
    Eigen::Vector2d gyro = Eigen::Vector2d::Zero();  ///< what the gyro says it should be [rad]
    std::optional<Eigen::Vector2d> odometry;         ///< what the odometry says it should be [rad]
    bool is_sure = true;                             ///< both images show the same place without doubt
  };
  enum class Verdict
  {
    agrees,
    jumped, ///< the last interval alone disagrees, and by far
    late,   ///< or early: see lag()
    mirrored,
    upside_down
  };
  Verdict add(const Interval &interval);
  /// Frames by which the images are late (negative: early).
  int lag() const { return m_lag; }
  void reset();

private:
  double cost(int lag, double sign_x, double sign_y, bool is_odometry) const;
  double variance() const;
  bool hasJumped() const;
  Verdict judgeWindow();

  std::deque<Interval> m_intervals;
  int m_lag = 0;
  bool m_is_late = false;
  Verdict m_suspected = Verdict::agrees;
  int m_suspected_lag = 0;
  int m_same = 0;
};
} // namespace bole
