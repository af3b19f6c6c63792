// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the factors of a graph measure (Eq. 2) and how much an outlier may pull. Tangents are those of Pose,
/// (rho [m], phi [rad]) on the right, and of Trunk, (x [m], y [m], log r, lean x, lean y). A square root information
/// matrix S of a covariance has S^T S = covariance^-1.

#include <bole/summary_factor.h>

#include <string>

namespace bole
{
/// A pose that is known: r = S (wMb (-) mean).
struct PosePrior
{
  Pose mean;                                  ///< wMb
  Matrix6d covariance = Matrix6d::Identity(); ///< of the tangent (rho, phi) at the mean
};

/// The pose of b in a, as odometry measures it: r = S ((wMa^-1 wMb) (-) aMb).
struct Odometry
{
  Pose aMb;                                   ///< measured step from pose a to pose b, body frames
  Matrix6d covariance = Matrix6d::Identity(); ///< of the tangent (rho, phi) at aMb
};

/// What two views of a scene of points say about the motion between them: everything but the length
/// of the translation. In camera frames: caRcb takes coordinates of camera b to camera a, direction
/// is the unit vector from the centre of camera a to that of camera b, in a's coordinates.
///
/// Residual: (Log(caRcb^T R), angle of the predicted direction in the tangent plane of the measured
/// one, in the basis directionBasis(direction)). A predicted translation shorter than kMinBaseline
/// has no direction: those two rows are then zero.
struct RelativePoseMeasurement
{
  Eigen::Matrix3d caRcb = Eigen::Matrix3d::Identity();  ///< rotation from the earlier to the later camera
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ(); ///< of the translation in the earlier camera, of length 1
  Matrix5d covariance = Matrix5d::Identity();           ///< (phi [rad], directionBasis angles [rad])
};
constexpr double kMinBaseline = 1e-4; ///< [m]

/// Independent normal priors on a trunk: with a weak one on x and y a trunk that nobody has seen
/// twice is still well defined, and its covariance says how little is known of it.
struct TrunkPrior
{
  Trunk mean;                        ///< about which the prior is centred
  Vector5d sigma = Vector5d::Ones(); ///< of the five numbers of Trunk::minus [m, m, -, -, -]
};

/// Robust losses: how much a residual that is far too large may still pull.
enum class LossKind
{
  quadratic, ///< rho(s) = s
  huber,     ///< s below width^2, then 2 width sqrt(s) - width^2
  cauchy     ///< width^2 log(1 + s / width^2): a gross outlier pulls less and less
};
/// As options write it.
const char *toString(LossKind kind);
/// Throws vpException(badValue) for an unknown name.
LossKind lossKindFromString(const std::string &name);

/// rho(s) of the squared whitened residual s; a factor costs rho(s) / 2.
///
/// Laws (each a test): rho(0) == 0; weight is the derivative of rho; weight(0) == 1; weight never
/// rises.
struct Loss
{
  LossKind kind = LossKind::quadratic; ///< form of the loss
  double width = 3;                    ///< in standard deviations, > 0

  /// Loss of the squared normalised residual \p s.
  double rho(double s) const;
  double weight(double s) const; ///< rho'(s)
};
} // namespace bole
