// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A visual feature that moves as the drone was told to, and drifts besides.
///
/// Idea: a Kalman filter on (value, drift). The value moves by what the drone is believed to have done (interaction
/// matrix times path) and by a drift that is learnt from the images: the target's own motion, wind, and whatever the
/// drone does not obey. The drift is the estimate of de/dt that visual servoing feeds forward to leave no lag.

#include <Eigen/Core>

namespace bole
{
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
