// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far a trajectory is from the truth.

#include "input/trajectory.h"
#include <bole/evaluation.h>

#include <map>
#include <vector>

namespace bole
{
/// p of the estimate becomes (scale * Rz(yaw) * p.xy + t, p.z + dz).
struct PlanarTransform
{
  double scale = 1;
  double yaw = 0;                              ///< [rad]
  Eigen::Vector2d t = Eigen::Vector2d::Zero(); ///< [m]
  double dz = 0;                               ///< [m]

  Eigen::Vector2d operator*(const Eigen::Vector2d &xy) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d &p) const;
  Eigen::Matrix2d linear() const; ///< scale * Rz(yaw)
  Pose operator*(const Pose &wMb) const;
};

/// A pose of the estimate and the truth at the same stamp (the truth interpolated).
struct PosePair
{
  std::int64_t stamp_ns = 0;
  Pose estimate, truth;
};

/// Pairs at the stamps of \p estimate that lie within the range of \p truth.
std::vector<PosePair> pairPoses(const Trajectory &estimate, const Trajectory &truth);

/// What must be added to the stamps of \p estimate [ns] for its motion to be that of \p truth: of
/// the shifts within \p range_s of \p start_ns, the one with the least relative error (translation
/// in m plus rotation in rad, over 0.3 s), to a millisecond. Where the two lie in the world does not
/// matter. A flight that changes neither speed nor attitude does not tell its time.
std::int64_t motionShift(const Trajectory &estimate, const Trajectory &truth, std::int64_t start_ns,
                         double range_s = 2);

/// The transform of \p alignment in closed form: yaw = atan2 of the summed cross and dot products of the centred
/// horizontal positions, scale = their ratio. Identity for no pairs; a trajectory that does not move keeps scale 1.
PlanarTransform align(const std::vector<PosePair> &pairs, Alignment alignment);

/// Errors after \p transform.
TrajectoryErrors absoluteErrors(const std::vector<PosePair> &pairs, const PlanarTransform &transform);

/// e^T P^-1 e / 2, e the error of \p xy [m] and P its \p covariance [m^2] after \p gauge; NaN where P is singular.
double halfNees(const Eigen::Vector2d &xy, const Eigen::Matrix2d &covariance, const Eigen::Vector2d &true_xy,
                const PlanarTransform &gauge);

/// Mean halfNees() of the positions in the plane, with the covariances that the estimate states, by stamp: 1 when they
/// are honest. The first pose, the gauge of both, is left out.
double consistency(const std::vector<PosePair> &pairs, const std::map<std::int64_t, Eigen::Matrix2d> &covariances,
                   const PlanarTransform &gauge);

/// Relative pose error over \p delta_s: (truth_i^-1 truth_j)^-1 (estimate_i^-1 estimate_j), j the
/// first pose at least \p delta_s (less half a millisecond) after i and no later than twice that.
RelativeErrors relativeErrors(const std::vector<PosePair> &pairs, double delta_s);
} // namespace bole
