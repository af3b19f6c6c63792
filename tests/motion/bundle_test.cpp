// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/bundle.h"

#include "geometry/so3.h"
#include <bole/trunk.h>

#include <gtest/gtest.h>

namespace
{
using namespace bole;
using motion::reprojection;

const Pose kA(expSo3({0.1, -0.2, 0.05}), {0.3, -0.1, 0.2});
const Pose kB(expSo3({0.12, -0.1, 0.02}), {0.6, -0.15, 0.5});
const Eigen::Vector2d kXy(0.2, -0.1), kSeen(0.15, -0.12);
constexpr double kInverseDepth = 0.2;

double jacobianError(double step)
{
  Eigen::Matrix<double, 2, 6> J_a, J_b;
  Eigen::Vector2d J_q;
  reprojection(kA, kB, kXy, kInverseDepth, kSeen, &J_a, &J_b, &J_q);
  double worst = 0;
  for (int i = 0; i < 6; ++i) {
    Vector6d xi = Vector6d::Zero();
    xi[i] = step;
    const Eigen::Vector2d by_a = (reprojection(kA.plus(xi), kB, kXy, kInverseDepth, kSeen) -
                                  reprojection(kA.plus(-xi), kB, kXy, kInverseDepth, kSeen)) /
                                 (2 * step);
    const Eigen::Vector2d by_b = (reprojection(kA, kB.plus(xi), kXy, kInverseDepth, kSeen) -
                                  reprojection(kA, kB.plus(-xi), kXy, kInverseDepth, kSeen)) /
                                 (2 * step);
    worst = std::max({worst, (by_a - J_a.col(i)).norm(), (by_b - J_b.col(i)).norm()});
  }
  const Eigen::Vector2d by_q = (reprojection(kA, kB, kXy, kInverseDepth + step, kSeen) -
                                reprojection(kA, kB, kXy, kInverseDepth - step, kSeen)) /
                               (2 * step);
  return std::max(worst, (by_q - J_q).norm());
}

TEST(Reprojection, JacobiansAgreeWithCentralDifferencesAtTwoSteps)
{
  const double coarse = jacobianError(2e-3), fine = jacobianError(1e-3);
  EXPECT_LT(fine, 1e-5);
  EXPECT_NEAR(coarse / fine, 4, 0.4);
}
} // namespace
