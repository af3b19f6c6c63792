// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "geometry/so3.h"
#include "summary/square_root.h"

namespace
{
using namespace bole;

struct Random
{
  std::mt19937 engine{5};
  std::normal_distribution<double> normal;
  Vector4d vector()
  {
    return Vector4d::NullaryExpr([this] { return normal(engine); });
  }
  Matrix4d matrix()
  {
    return Matrix4d::NullaryExpr([this] { return normal(engine); });
  }
};

/// A factor with a Hessian of the given rank and a gradient in its range.
SummaryFactor factorOfRank(Random &random, int rank)
{
  SummaryFactor factor;
  factor.optimum.cRt = expSo3(0.4 * random.vector().head<3>());
  factor.optimum.log_ratio = -2.5 + 0.3 * random.normal(random.engine);
  Matrix4d A = random.matrix();
  A.bottomRows(4 - rank).setZero();
  factor.F = 100 * A.transpose() * A;
  factor.f = factor.F * (0.1 * random.vector());
  factor.energy = random.normal(random.engine);
  return factor;
}

TEST(SummaryFactor, HasItsEnergyAndItsGradientAtTheOptimum)
{
  Random random;
  const SummaryFactor factor = factorOfRank(random, 4);
  EXPECT_DOUBLE_EQ(factor.energyAt(factor.optimum), factor.energy);
  for (int i = 0; i < 4; ++i) {
    const Vector4d h = 1e-4 * Vector4d::Unit(i);
    const double slope = (factor.energyAt(factor.optimum.plus(h)) - factor.energyAt(factor.optimum.plus(-h))) / 2e-4;
    EXPECT_NEAR(slope, factor.f(i), 1e-6 * factor.f.norm());
  }
}

TEST(SquareRootSummary, IsTheSameEnergyAsASumOfSquares)
{
  Random random;
  for (int k = 0; k < 50; ++k)
    for (int rank = 1; rank <= 4; ++rank) {
      const SummaryFactor factor = factorOfRank(random, rank);
      SquareRootSummary root;
      ASSERT_EQ(squareRoot(factor, root), SummaryStatus::ok) << rank;
      EXPECT_LT((root.S.transpose() * root.S - factor.F).norm(), 1e-9 * factor.F.norm());
      const RelativeTrunk at = factor.optimum.plus(0.1 * random.vector());
      const double energy = 0.5 * root.residual(at).squaredNorm() + root.constant;
      EXPECT_NEAR(energy, factor.energyAt(at), 1e-7 * (1 + std::abs(energy)));
      EXPECT_NEAR(energy, root.factor().energyAt(at), 1e-7 * (1 + std::abs(energy)));
    }
}

TEST(SquareRootSummary, SetsAnEigenvalueJustBelowZeroToZero)
{
  Random random;
  SummaryFactor factor = factorOfRank(random, 3);
  factor.f.setZero();
  const Eigen::SelfAdjointEigenSolver<Matrix4d> eigen(factor.F);
  const Vector4d v = eigen.eigenvectors().col(0);
  const double largest = eigen.eigenvalues()(3);
  SquareRootSummary root;
  factor.F -= 0.5 * kIndefiniteTolerance * largest * v * v.transpose();
  EXPECT_EQ(squareRoot(factor, root), SummaryStatus::projected);
  EXPECT_LT((root.S * v).norm(), 1e-6 * std::sqrt(largest));
}

TEST(SquareRootSummary, RefusesNegativeCurvatureAndLeavesTheRootAlone)
{
  Random random;
  SummaryFactor factor = factorOfRank(random, 4);
  SquareRootSummary root;
  root.constant = 17;
  factor.F(0, 0) = -factor.F.norm();
  EXPECT_EQ(squareRoot(factor, root), SummaryStatus::indefinite);
  EXPECT_EQ(root.constant, 17);
}

TEST(SquareRootSummary, RefusesWhatIsNoNumberAndWhatIsNoRelativeTrunk)
{
  Random random;
  const SummaryFactor good = factorOfRank(random, 4);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  SquareRootSummary root;
  const auto refused = [&](auto spoil) {
    SummaryFactor factor = good;
    spoil(factor);
    return squareRoot(factor, root) == SummaryStatus::not_finite;
  };
  EXPECT_TRUE(refused([&](SummaryFactor &f) { f.F(1, 2) = nan; }));
  EXPECT_TRUE(refused([&](SummaryFactor &f) { f.f(3) = std::numeric_limits<double>::infinity(); }));
  EXPECT_TRUE(refused([&](SummaryFactor &f) { f.energy = nan; }));
  EXPECT_TRUE(refused([&](SummaryFactor &f) { f.optimum.log_ratio = 0.1; })); // inside the trunk
  EXPECT_TRUE(refused([&](SummaryFactor &f) { f.optimum.cRt *= 1.1; }));
  EXPECT_FALSE(refused([](SummaryFactor &) {}));
}
} // namespace
