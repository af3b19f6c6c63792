// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/epipolar.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

namespace
{
using namespace bole;
using namespace bole::motion;

const Motion kMotion{expSo3({0.02, -0.03, 0.01}), Eigen::Vector3d(0.8, 0.1, 0.5).normalized()};

Rays matches()
{
  Rays rays;
  for (int i = 0; i < 41; ++i) {
    const Eigen::Vector3d b(0.7 * std::sin(1.7 * i), 0.5 * std::cos(2.9 * i), 1);
    const Eigen::Vector3d a = kMotion.aRb * b + (0.02 + 0.001 * i) * kMotion.direction +
                              0.003 * Eigen::Vector3d(std::sin(5.0 * i), std::cos(3.0 * i), 0);
    rays.add(a / a.z(), b);
  }
  return rays;
}

TEST(EpipolarLoops, AddUpWhatEachMatchSays)
{
  const Rays rays = matches();
  const double sigma = 0.002;
  const Epipolar epipolar(kMotion);
  double cost = 0;
  Matrix5d H = Matrix5d::Zero();
  Vector5d g = Vector5d::Zero();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Vector5d J;
    const double r = epipolar.residual(rays.a[i], rays.b[i], J) / sigma, trust = epipolar.trust(rays.a[i]);
    const double w = trust * weightOf(r, kKernel);
    cost += trust * costOf(r, kKernel);
    H += w / (sigma * sigma) * J * J.transpose();
    g += w * r / sigma * J;
  }
  const EpipolarTerms terms = epipolar.terms(sigma, kKernel);
  EXPECT_NEAR(costOfMatches(rays.columns, terms), cost, 1e-9 * cost);
  const EpipolarSums sums = sumsOfMatches(rays.columns, terms);
  const double *entry = sums.H;
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(sums.g[i], g(i), 1e-9 * g.norm()) << i;
    for (int j = i; j < 5; ++j)
      EXPECT_NEAR(*entry++, H(i, j), 1e-9 * H.norm()) << i << " " << j;
  }
}

TEST(EpipolarLoops, ResidualsAreThoseOfEachMatch)
{
  const Rays rays = matches();
  const Epipolar epipolar(kMotion);
  std::vector<double> residuals(rays.size());
  residualsOfMatches(rays.columns, epipolar.terms(1, kKernel), residuals.data());
  for (std::size_t i = 0; i < rays.size(); ++i)
    EXPECT_NEAR(residuals[i], epipolar.residual(rays.a[i], rays.b[i]), 1e-12) << i;
}

TEST(EpipolarLoops, DerivativesByTheShearAgreeWithCentralDifferences)
{
  const Rays rays = matches();
  const Epipolar epipolar(kMotion);
  const double sigma = 0.002, shear = 0.03, h = 1e-5;
  EpipolarTerms terms = epipolar.terms(sigma, kKernel);
  const auto residualsAt = [&](double at) {
    std::vector<double> residuals(rays.size());
    terms.shear = at;
    residualsOfMatches(rays.columns, terms, residuals.data());
    return residuals;
  };
  const std::vector<double> plus = residualsAt(shear + h), minus = residualsAt(shear - h), here = residualsAt(shear);
  double H = 0, g = 0, H_turn = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Vector5d J;
    const Eigen::Vector3d b = rays.b[i] - shear * rays.b[i].y() * Eigen::Vector3d::UnitX();
    epipolar.residual(rays.a[i], b, J);
    const double by_shear = (plus[i] - minus[i]) / (2 * h) / sigma;
    const double w = epipolar.trust(rays.a[i]) * weightOf(here[i] / sigma, kKernel);
    H += w * by_shear * by_shear;
    H_turn += w * by_shear * J(0) / sigma;
    g += w * by_shear * here[i] / sigma;
  }
  const ShearSums sums = shearSumsOfMatches(rays.columns, terms);
  EXPECT_NEAR(sums.H[20], H, 1e-6 * H);
  EXPECT_NEAR(sums.H[5], H_turn, 1e-6 * H);
  EXPECT_NEAR(sums.g[5], g, 1e-6 * H);
}

TEST(EpipolarLoops, DerivativesByTheRotationAgreeWithCentralDifferences)
{
  const Rays rays = matches();
  const std::size_t n = rays.size();
  const double h = 1e-5, variance = 1e-4;
  const auto residualsAt = [&](const Eigen::Vector3d &phi) {
    const Eigen::Matrix3d aRb = kMotion.aRb * expSo3(phi);
    std::vector<double> residuals(2 * n);
    transferResiduals(rays.columns, {aRb.data(), kKernel}, residuals.data());
    return residuals;
  };
  const std::vector<double> here = residualsAt(Eigen::Vector3d::Zero());
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  std::array<std::vector<double>, 3> plus, minus;
  for (int k = 0; k < 3; ++k) {
    plus[std::size_t(k)] = residualsAt(h * Eigen::Vector3d::Unit(k));
    minus[std::size_t(k)] = residualsAt(-h * Eigen::Vector3d::Unit(k));
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double w = weightOf(std::hypot(here[i], here[n + i]) / std::sqrt(variance), kKernel);
    for (const std::size_t at : {i, n + i}) {
      Eigen::Vector3d J;
      for (std::size_t k = 0; k < 3; ++k)
        J(Eigen::Index(k)) = (plus[k][at] - minus[k][at]) / (2 * h);
      H += w * J * J.transpose();
      g += w * J * here[at];
    }
  }
  std::vector<double> weights(n);
  const TransferSums sums =
      sumsOfTransfers(rays.columns, {kMotion.aRb.data(), kKernel}, here.data(), variance, weights.data());
  const double *entry = sums.H;
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sums.g[i], g(i), 1e-6 * H.norm()) << i;
    for (int j = i; j < 3; ++j)
      EXPECT_NEAR(*entry++, H(i, j), 1e-6 * H.norm()) << i << " " << j;
  }
}
} // namespace
