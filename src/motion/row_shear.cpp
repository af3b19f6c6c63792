// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/row_shear.h"

#include "geometry/solve_definite.h"
#include "motion/epipolar.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <optional>

namespace bole
{
namespace
{
constexpr double kWideShear = 1; // sigma of the shear before anything is seen

/// Gauss-Newton with redescending weights, their scale that of the bulk in each step.
std::optional<RowShear> fitShear(const motion::Rays &rays, motion::Motion motion, const motion::MotionPrior &prior,
                                 double min_sigma)
{
  constexpr int kIterations = 8;
  constexpr double kSettled = 1e-5; // of a step: a hundredth of a pixel over 1000 rows
  RowShear fit;
  double shear = 0;
  std::vector<double> residuals(rays.size());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    motion::EpipolarTerms terms = motion::termsOf(motion, 1);
    terms.shear = shear;
    residualsOfMatches(rays, terms, residuals.data());
    const double sigma = terms.sigma = std::max(min_sigma, motion::bulkSigma(residuals));
    const motion::ShearSums sums = shearSumsOfMatches(rays, terms);
    Matrix6d H;
    const double *entry = sums.H;
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j)
        H(i, j) = H(j, i) = *entry++ / motion::kInflation;
    Vector6d g = Vector6d::Map(sums.g) / motion::kInflation;
    const double wide = 1 / (kWideShear * kWideShear);
    H.topLeftCorner<3, 3>() += prior.rotation_information;
    H.diagonal().array() += 1e-9;
    H.diagonal().tail<3>() += Eigen::Vector3d(prior.direction_information, prior.direction_information, wide);
    g.head<3>() += prior.rotation_information * logSo3(prior.aRb.transpose() * motion.aRb);
    g.segment<2>(3) -= prior.direction_information * directionMinus(prior.direction, motion.direction);
    g(5) += wide * shear;
    const Vector6d step = -solveDefinite(H, g);
    motion.aRb = orthonormalized(motion.aRb * expSo3(step.head<3>()));
    motion.direction = directionPlus(motion.direction, step.segment<2>(3));
    shear += step(5);
    if (!std::isfinite(shear) || std::abs(shear) > kWideShear)
      return std::nullopt;
    fit = {shear, std::sqrt(solveDefinite<6>(H, Vector6d::Unit(5))(5)), {motion.aRb, motion.direction}, sigma};
    if (step.norm() < kSettled)
      break;
  }
  return fit;
}
} // namespace

RowShear estimateRowShear(const std::vector<PointMatch> &matches, const PinholeCamera &camera,
                          const RelativePosePrior &given, const std::vector<Pose> &starts, double min_sigma_px)
{
  if (matches.size() < RelativePoseEstimate::kLeastMatches)
    return {};
  const motion::MotionPrior prior(given);
  const motion::Rays rays(matches, camera);
  const double min_sigma = min_sigma_px / std::sqrt(camera.fx * camera.fy);
  std::optional<RowShear> best;
  for (const Pose &start : starts) {
    const auto fit = fitShear(rays, {start.R, start.t.normalized()}, prior, min_sigma);
    if (fit && (!best || fit->noise < best->noise))
      best = fit;
  }
  return best.value_or(RowShear());
}

double gainOfShear(const RowShear &row, const std::vector<PointMatch> &matches, const PinholeCamera &camera,
                   const RelativePosePrior &given, const std::vector<Pose> &starts, double min_sigma_px)
{
  const motion::MotionPrior prior(given);
  const motion::Rays rays(matches, camera);
  motion::Rays upright;
  for (std::size_t i = 0; i < rays.size(); ++i)
    upright.add(rays.a(i), rays.b(i) - row.shear * rays.b(i).y() * Eigen::Vector3d::UnitX());
  const double min_sigma = min_sigma_px / std::sqrt(camera.fx * camera.fy);
  const auto costFrom = [&](const motion::Rays &from, const Pose &start) {
    const motion::JointFit fit = motion::fitMotion(from, {start.R, start.t.normalized()}, prior, row.noise, min_sigma);
    return motion::costOf(from, fit.motion, prior, row.noise);
  };
  double without = costFrom(rays, row.aMb);
  for (const Pose &start : starts)
    without = std::min(without, costFrom(rays, start));
  return 2 * (without - costFrom(upright, row.aMb));
}
} // namespace bole
