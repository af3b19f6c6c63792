// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The pieces of estimateRelativePose(): matches as rays, robust weights, the rotation-only fit,
/// the joint fit and the statistics of parallax.

#include <bole/motion/relative_pose.h>

#include <vector>

namespace bole::motion
{
/// Matches as (x, y, 1) of both frames.
struct Rays
{
  std::vector<Eigen::Vector3d> a, b;

  Rays() = default;
  Rays(const std::vector<PointMatch> &matches, const PinholeCamera &camera);
  std::size_t size() const { return a.size(); }
};

struct Motion
{
  Eigen::Matrix3d aRb = Eigen::Matrix3d::Identity();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// Priors as information matrices; zero where there is none.
struct MotionPrior
{
  Eigen::Matrix3d aRb = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d rotation_information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double direction_information = 0; ///< isotropic [1/rad^2]
  bool has_rotation = false, has_direction = false;

  explicit MotionPrior(const RelativePosePrior &prior);
};

/// Geman and McClure: weight of a residual of \p u sigmas with the kernel \p c, and its cost.
inline double weightOf(double u, double c)
{
  const double q = 1 / (1 + u * u / (c * c));
  return q * q;
}
inline double costOf(double u, double c) { return 0.5 * u * u / (1 + u * u / (c * c)); }

/// Standard deviation of the bulk of \p residuals: median, then the spread of those within 2.5
/// sigmas.
double bulkSigma(std::vector<double> residuals);

/// Rotation alone, all points taken as infinitely far.
struct RotationFit
{
  Eigen::Matrix3d aRb = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero(); ///< with the prior [1/rad^2]
  double sigma = 0; ///< of one coordinate of one image [normalised]
  std::vector<double> weights;
};
RotationFit fitRotation(const Rays &rays, const MotionPrior &prior, double min_sigma,
                        const RelativePoseOptions &options);

/// Rotation and direction together. \p sigma is refined on the way.
struct JointFit
{
  Motion motion;
  Matrix5d information = Matrix5d::Zero(); ///< of the matches alone, inflation not applied
  double sigma = 0, cost = 0;
};
JointFit fitMotion(const Rays &rays, const Motion &start, const MotionPrior &prior, double sigma,
                   double min_sigma, const RelativePoseOptions &options);

/// Flow that is left when the rotation is taken out, along and across the epipolar lines
/// [normalised].
struct Parallax
{
  double ratio = 0;  ///< mean square along / across
  double score = 0;  ///< sigmas by which the flow agrees on the sign of the direction
  double median = 0; ///< length
};
Parallax parallaxOf(const Rays &rays, const Motion &motion, double sigma, double kernel);

/// Starts for fitMotion(): the prior's direction and the best of two-point directions.
std::vector<Motion> motionStarts(const Rays &rays, const Eigen::Matrix3d &aRb,
                                 const MotionPrior &prior, double sigma,
                                 const RelativePoseOptions &options);
} // namespace bole::motion
