// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/differences.h"

#include "motion/epipolar.h"

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

std::vector<double> residualsAt(const Rays &rays, const Motion &motion, double shear = 0)
{
  std::vector<double> residuals(rays.size());
  EpipolarTerms terms = termsOf(motion, 1);
  terms.shear = shear;
  residualsOfMatches(rays, terms, residuals.data());
  return residuals;
}

/// Of all residuals, by rotation and direction: central differences at the step \p h.
Eigen::MatrixXd derivatives(const Rays &rays, double h, double shear = 0)
{
  const auto residuals = [&](const Vector5d &xi) {
    const auto r =
        residualsAt(rays, {kMotion.aRb * expSo3(xi.head<3>()), directionPlus(kMotion.direction, xi.tail<2>())}, shear);
    return Eigen::VectorXd(Eigen::VectorXd::Map(r.data(), static_cast<Eigen::Index>(r.size())));
  };
  return test::differences(residuals, 5, h);
}

/// Near the epipole a line is drawn by noise.
double trust(const Eigen::Vector3d &x_a)
{
  const double sine2 = kMotion.direction.cross(x_a).squaredNorm() / x_a.squaredNorm();
  return sine2 / (sine2 + kEpipole * kEpipole);
}

TEST(EpipolarLoops, AddUpWhatEachMatchSays)
{
  const Rays rays = matches();
  const double sigma = 0.002;
  const EpipolarTerms terms = termsOf(kMotion, sigma);
  const std::vector<double> residuals = residualsAt(rays, kMotion);
  const EpipolarSums sums = sumsOfMatches(rays, terms);
  double cost = 0;
  const auto compare = [&](const Eigen::MatrixXd &J) { // the largest errors of H and g, in proportion
    Matrix5d H = Matrix5d::Zero();
    Vector5d g = Vector5d::Zero();
    cost = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Vector5d by = J.row(static_cast<Eigen::Index>(i)).transpose() / sigma;
      const double r = residuals[i] / sigma, share = trust(rays.a(i));
      cost += share * costOf(r, kKernel);
      H += share * weightOf(r, kKernel) * by * by.transpose();
      g += share * weightOf(r, kKernel) * r * by;
    }
    const double *entry = sums.H;
    double worst = (Vector5d::Map(sums.g) - g).cwiseAbs().maxCoeff() / g.norm();
    for (int i = 0; i < 5; ++i)
      for (int j = i; j < 5; ++j)
        worst = std::max(worst, std::abs(*entry++ - H(i, j)) / H.norm());
    return worst;
  };
  const double h = 2e-3;
  const Eigen::MatrixXd coarse = derivatives(rays, h), fine = derivatives(rays, h / 2);
  EXPECT_NEAR(compare(coarse) / compare(fine), 4, 0.1);
  EXPECT_LT(compare((4 * fine - coarse) / 3), 1e-9); // without the error of second order
  EXPECT_NEAR(costOfMatches(rays, terms), cost, 1e-9 * cost);
}

TEST(EpipolarLoops, ResidualsAreThoseOfEachMatch)
{
  const Rays rays = matches();
  const std::vector<double> residuals = residualsAt(rays, kMotion);
  const Eigen::Matrix3d E = skew(kMotion.direction) * kMotion.aRb;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d line_a = E * rays.b(i), line_b = E.transpose() * rays.a(i);
    EXPECT_NEAR(residuals[i],
                rays.a(i).dot(line_a) / std::sqrt(line_a.head<2>().squaredNorm() + line_b.head<2>().squaredNorm()),
                1e-12)
        << i;
  }
}

TEST(EpipolarLoops, DerivativesByTheShearAgreeWithCentralDifferences)
{
  const Rays rays = matches();
  const double sigma = 0.002, shear = 0.03, h = 1e-5;
  EpipolarTerms terms = termsOf(kMotion, sigma);
  terms.shear = shear;
  const std::vector<double> plus = residualsAt(rays, kMotion, shear + h), minus = residualsAt(rays, kMotion, shear - h),
                            here = residualsAt(rays, kMotion, shear);
  const Eigen::MatrixXd J = derivatives(rays, h, shear);
  double H = 0, g = 0, H_turn = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double by_shear = (plus[i] - minus[i]) / (2 * h) / sigma;
    const double w = trust(rays.a(i)) * weightOf(here[i] / sigma, kKernel);
    H += w * by_shear * by_shear;
    H_turn += w * by_shear * J(static_cast<Eigen::Index>(i), 0) / sigma;
    g += w * by_shear * here[i] / sigma;
  }
  const ShearSums sums = shearSumsOfMatches(rays, terms);
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
    transferResiduals(rays, aRb.data(), residuals.data());
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
  const TransferSums sums = sumsOfTransfers(rays, kMotion.aRb.data(), here.data(), variance);
  const double *entry = sums.H;
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sums.g[i], g(i), 1e-6 * H.norm()) << i;
    for (int j = i; j < 3; ++j)
      EXPECT_NEAR(*entry++, H(i, j), 1e-6 * H.norm()) << i << " " << j;
  }
}
} // namespace
