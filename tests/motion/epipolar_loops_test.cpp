// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/epipolar.h"

#include <gtest/gtest.h>

namespace
{
using namespace bole;
using namespace bole::motion;

TEST(EpipolarLoops, AddUpWhatEachMatchSays)
{
  const Motion motion{expSo3({0.02, -0.03, 0.01}), Eigen::Vector3d(0.8, 0.1, 0.5).normalized()};
  Rays rays;
  for (int i = 0; i < 41; ++i) {
    const Eigen::Vector3d b(0.7 * std::sin(1.7 * i), 0.5 * std::cos(2.9 * i), 1);
    const Eigen::Vector3d a = motion.aRb * b + (0.02 + 0.001 * i) * motion.direction +
                              0.003 * Eigen::Vector3d(std::sin(5.0 * i), std::cos(3.0 * i), 0);
    rays.add(a / a.z(), b);
  }
  const double sigma = 0.002;
  const Epipolar epipolar(motion);
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
} // namespace
