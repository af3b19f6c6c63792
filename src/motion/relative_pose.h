// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Relative rotation and direction of translation of one camera between two frames, from point
/// matches.
///
/// Idea: a static point seen along x_a from frame a and x_b from frame b lies in a plane with both
/// camera centres: x_a . (d x aRb x_b) = 0. The distance of each match from fulfilling it
/// (Sampson's form: pixels of noise in both images, to first order) is minimised jointly over the
/// rotation and the direction d on their manifold, five degrees of freedom, by Gauss-Newton with
/// redescending weights: what moves by itself, and what was matched wrongly, loses its say. Gyro
/// and pose filter enter as Gaussian priors; without them the start comes from a rotation-only fit
/// and two-point directions drawn at random.
///
/// Frames: camera axes (x right, y down, z forward). `aRb` takes coordinates of b to a; `direction`
/// is the unit vector from a's centre to b's, in frame a: aMb = (aRb, scale * direction), the scale
/// is not seen. Covariance: order (phi, tau), phi [rad] in the right tangent aRb * Exp(phi), tau
/// [rad] in the tangent plane of the direction: directionPlus(direction, tau) in the basis
/// directionBasis(direction).
///
/// Laws (each a test): the Jacobian of Sampson's distance agrees with central differences; exact
/// matches give the exact motion; swapping a and b inverts it; a camera that only turns gets the
/// rotation and the status no_parallax.
///
/// Cost: about 0.3 ms for 150 matches with a gyro, 1 ms without.

#include "geometry/direction.h"
#include "motion/point_tracker.h"
#include <bole/camera.h>
#include <bole/trunk.h>

#include <optional>
#include <vector>

namespace bole
{
constexpr double kMatchSigma_px = 0.05; ///< floor of the noise of a match, one coordinate

/// What is known before the matches are looked at.
struct RelativePosePrior
{
  std::optional<Eigen::Matrix3d> aRb;                               ///< gyro
  Eigen::Matrix3d rotation_covariance = Eigen::Matrix3d::Zero();    ///< right tangent of aRb [rad^2]
  std::optional<Eigen::Vector3d> translation;                       ///< pose filter: b's centre in a [m]
  Eigen::Matrix3d translation_covariance = Eigen::Matrix3d::Zero(); ///< [m^2]
};

enum class RelativePoseStatus
{
  ok,
  too_few_points, ///< nothing estimated: rotation and direction are the prior's
  no_parallax,    ///< rotation only: the direction is the prior's (or z), with the covariance that
                  ///< says so
  ambiguous,      ///< two motions explain the matches equally well (a plane in view, no prior)
  inconsistent    ///< the matches do not agree on a motion: rotation and direction are the prior's
};

struct RelativePoseEstimate
{
  static constexpr std::size_t kLeastMatches = 12; ///< below it nothing is estimated

  RelativePoseStatus status = RelativePoseStatus::too_few_points;
  Eigen::Matrix3d aRb = Eigen::Matrix3d::Identity();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  Matrix5d covariance = Matrix5d::Identity(); ///< (phi, tau) [rad^2]
  double sigma_px = 0;                        ///< noise of a match, one coordinate
  double parallax_px = 0;                     ///< median flow left when the rotation is taken out

  bool hasRotation() const { return status == RelativePoseStatus::ok || status == RelativePoseStatus::no_parallax; }
  bool hasDirection() const { return status == RelativePoseStatus::ok; }
};

/// The motion between the frames of \p matches. Never throws on data; see the status.
RelativePoseEstimate estimateRelativePose(const std::vector<PointMatch> &matches, const PinholeCamera &camera,
                                          const RelativePosePrior &prior = {}, double min_sigma_px = kMatchSigma_px);
} // namespace bole
