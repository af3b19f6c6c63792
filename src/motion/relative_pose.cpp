// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/relative_pose.h"

#include "motion/epipolar.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
using motion::JointFit;
using motion::Motion;
using motion::MotionPrior;
using motion::Parallax;
using motion::Rays;
using motion::RotationFit;

constexpr double kSharedError = 0.1;
constexpr double kMostSigma_px = 1.5;     ///< above it the matches do not agree on one motion
constexpr double kLeastParallaxRatio = 2; ///< variance of the flow along over across the epipolar lines
constexpr double kUnknownDirection = 1e2; // variance of a direction that nobody has seen [rad^2]

void takePrior(RelativePoseEstimate &estimate, const RelativePosePrior &given, const MotionPrior &prior)
{
  estimate.aRb = prior.aRb;
  estimate.direction = prior.direction;
  estimate.covariance.setZero();
  estimate.covariance.topLeftCorner<3, 3>() =
      prior.has_rotation ? given.rotation_covariance : Eigen::Matrix3d(10 * Eigen::Matrix3d::Identity());
  estimate.covariance.bottomRightCorner<2, 2>() =
      (prior.direction_information > 0 ? 1 / prior.direction_information : kUnknownDirection) *
      Eigen::Matrix2d::Identity();
}

void takeRotation(RelativePoseEstimate &estimate, const RotationFit &fit)
{
  estimate.aRb = fit.aRb;
  estimate.covariance.topLeftCorner<3, 3>() = fit.information.ldlt().solve(Eigen::Matrix3d::Identity());
}

/// The covariance of the joint fit. A flow of pure noise also seems to know its direction: the
/// share of the flow along the lines that is no noise, 1 - 1/ratio, is the share of the direction's
/// information that is real.
Matrix5d covarianceOf(const JointFit &fit, const MotionPrior &prior, double ratio)
{
  Vector5d scale = Vector5d::Ones();
  scale.tail<2>().setConstant(std::sqrt(std::max(0.01, 1 - 1 / std::max(ratio, 1.0))));
  Matrix5d information = scale.asDiagonal() * fit.information * scale.asDiagonal();
  information /= motion::kInflation;
  information.topLeftCorner<3, 3>() += prior.rotation_information;
  information(3, 3) += prior.direction_information;
  information(4, 4) += prior.direction_information;
  information.diagonal().array() += 1e-9;
  return information.ldlt().solve(Matrix5d::Identity());
}

/// Best of the fits from all starts, signs of the directions settled by the depths; and whether
/// another is as good.
JointFit bestFit(const Rays &rays, const std::vector<Motion> &starts, const MotionPrior &prior, double sigma,
                 double min_sigma, bool &ambiguous)
{
  std::vector<JointFit> fits;
  for (Motion start : starts) {
    if (motion::parallaxOf(rays, start, sigma).score < 0)
      start.direction = -start.direction;
    fits.push_back(motion::fitMotion(rays, start, prior, sigma, min_sigma));
  }
  // Costs count in sigmas of the best fit's noise.
  const auto best = std::min_element(fits.begin(), fits.end(), [](const JointFit &x, const JointFit &y) {
    return x.cost * x.sigma * x.sigma < y.cost * y.sigma * y.sigma;
  });
  ambiguous = false;
  for (const JointFit &fit : fits) {
    const double angle = std::acos(std::clamp(std::abs(fit.motion.direction.dot(best->motion.direction)), 0.0, 1.0));
    const double excess = fit.cost * fit.sigma * fit.sigma / (best->sigma * best->sigma) - best->cost;
    const Parallax parallax = motion::parallaxOf(rays, fit.motion, fit.sigma);
    ambiguous = ambiguous || (angle > 0.2 && excess < 4 && std::abs(parallax.score) > 3);
  }
  return *best;
}
} // namespace

RelativePoseEstimate estimateRelativePose(const std::vector<PointMatch> &matches, const PinholeCamera &camera,
                                          const RelativePosePrior &given, double min_sigma_px)
{
  RelativePoseEstimate estimate;
  const MotionPrior prior(given);
  takePrior(estimate, given, prior);
  if (matches.size() < RelativePoseEstimate::kLeastMatches)
    return estimate;
  const double focal = std::sqrt(camera.fx * camera.fy);
  const double min_sigma = min_sigma_px / focal;
  const Rays rays(matches, camera);
  const Eigen::Matrix3d start_rotation =
      prior.has_rotation ? prior.aRb : motion::fitRotation(rays, prior, min_sigma).aRb;
  const double start_sigma = std::max(min_sigma, 0.4 / focal);
  const auto starts = motion::motionStarts(rays, start_rotation, prior, start_sigma);
  bool ambiguous = false;
  JointFit fit = bestFit(rays, starts, prior, start_sigma, min_sigma, ambiguous);
  Parallax parallax = motion::parallaxOf(rays, fit.motion, fit.sigma);
  if (parallax.score < -3) {
    fit.motion.direction = -fit.motion.direction;
    parallax.score = -parallax.score;
  }
  estimate.sigma_px = fit.sigma * focal;
  const double flow = motion::medianFlow(rays, fit.motion.aRb);
  estimate.parallax_px = flow * focal;
  if (estimate.sigma_px > kMostSigma_px) {
    estimate.status = RelativePoseStatus::inconsistent;
    return estimate;
  }
  if (parallax.ratio < kLeastParallaxRatio || parallax.score < 3) {
    estimate.status = RelativePoseStatus::no_parallax;
    takeRotation(estimate, motion::fitRotation(rays, prior, min_sigma));
    return estimate;
  }
  estimate.status = ambiguous && !prior.has_rotation ? RelativePoseStatus::ambiguous : RelativePoseStatus::ok;
  estimate.aRb = fit.motion.aRb;
  estimate.direction = fit.motion.direction;
  estimate.covariance = covarianceOf(fit, prior, parallax.ratio);
  // However many the points: errors that they share do not average below a tenth of noise over
  // parallax.
  const double shared = kSharedError * fit.sigma / std::max(flow, fit.sigma);
  estimate.covariance.bottomRightCorner<2, 2>() += shared * shared * Eigen::Matrix2d::Identity();
  return estimate;
}
} // namespace bole
