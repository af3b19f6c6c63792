// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The pieces of estimateRelativePose(): matches as rays, robust weights, the rotation-only fit,
/// the joint fit and the statistics of parallax.

#include "geometry/so3.h"
#include "motion/epipolar_loops.h"
#include "motion/relative_pose.h"

#include <Eigen/Geometry>

#include <cmath>
#include <vector>

namespace bole::motion
{
/// Covariance is multiplied by this: errors of neighbouring tracks are not independent. Chosen so that the normalised
/// error squared of the rendered flights is near its degrees of freedom.
constexpr double kInflation = 3;
constexpr int kHypotheses = 48; ///< two-point directions tried without a prior
constexpr unsigned kSeed = 1;   ///< of the draws

/// A camera whose focal lengths are \p factor times those of \p camera.
inline PinholeCamera withFocal(PinholeCamera camera, double factor)
{
  camera.fx *= factor;
  camera.fy *= factor;
  return camera;
}

/// Matches as (x, y, 1) of both frames.
struct Rays : RayColumns
{
  Rays() = default;
  Rays(const std::vector<PointMatch> &matches, const PinholeCamera &camera);
  void add(const Eigen::Vector3d &in_a, const Eigen::Vector3d &in_b);
  void clear(); ///< keeps the memory
  std::size_t size() const { return ax.size(); }
  Eigen::Vector3d a(std::size_t i) const { return {ax[i], ay[i], 1}; }
  Eigen::Vector3d b(std::size_t i) const { return {bx[i], by[i], 1}; }
};

struct Motion
{
  Eigen::Matrix3d aRb = Eigen::Matrix3d::Identity();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// For the sums over all matches.
EpipolarTerms termsOf(const Motion &motion, double sigma);

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
  double sigma = 0;                                      ///< of one coordinate of one image [normalised]
};
RotationFit fitRotation(const Rays &rays, const MotionPrior &prior, double min_sigma);

/// Rotation and direction together. \p sigma is refined on the way.
struct JointFit
{
  Motion motion;
  Matrix5d information = Matrix5d::Zero(); ///< of the matches alone, inflation not applied
  double sigma = 0, cost = 0;
};
/// Robust cost of the matches at the noise \p sigma, that of the prior with it: half the chi-squared of small
/// residuals.
double costOf(const Rays &rays, const Motion &motion, const MotionPrior &prior, double sigma);
JointFit fitMotion(const Rays &rays, const Motion &start, const MotionPrior &prior, double sigma, double min_sigma);

/// Flow that is left when the rotation is taken out, along and across the epipolar lines
/// [normalised].
struct Parallax
{
  double ratio = 0; ///< mean square along / across
  double score = 0; ///< sigmas by which the flow agrees on the sign of the direction
};
Parallax parallaxOf(const Rays &rays, const Motion &motion, double sigma);
/// Median length of that flow.
double medianFlow(const Rays &rays, const Eigen::Matrix3d &aRb);

/// Starts for fitMotion(): the prior's direction and the best of two-point directions.
std::vector<Motion> motionStarts(const Rays &rays, const Eigen::Matrix3d &aRb, const MotionPrior &prior, double sigma);
} // namespace bole::motion
