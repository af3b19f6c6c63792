// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/differences.h"

#include "geometry/so3.h"
#include "smoothing/factors.h"
#include <bole/smoother.h>

using namespace bole;

namespace
{
using Eigen::MatrixXd;
using Eigen::VectorXd;

void expectDerivative(const test::Function &f, const MatrixXd &J)
{
  test::expectDerivative(f, J, 1e-2, 2e-3 * (1 + J.cwiseAbs().maxCoeff()));
}

const Pose kA(expSo3({0.1, -0.2, 0.5}), {1, 2, 3});
const Pose kB(expSo3({0.3, 0.1, 0.7}), {2, 2.5, 3.2});
const Pose kMc(SmootherOptions::forwardCamera().R *expSo3({0.05, 0.02, 0.01}), {0.1, 0.02, -0.03});

TEST(Factors, OdometryJacobiansAgreeWithDifferences)
{
  Odometry o;
  o.aMb = (kA.inverse() * kB).plus(0.1 * Vector6d::Ones());
  const Matrix6d S = Vector6d(1, 2, 3, 4, 5, 6).asDiagonal();
  Matrix6d J_a, J_b;
  residual(o, S, kA, kB, &J_a, &J_b);
  expectDerivative([&](const VectorXd &d) { return residual(o, S, kA.plus(d), kB, nullptr, nullptr); }, J_a);
  expectDerivative([&](const VectorXd &d) { return residual(o, S, kA, kB.plus(d), nullptr, nullptr); }, J_b);
}

TEST(Factors, RelativePoseJacobiansAgreeWithDifferences)
{
  RelativePoseMeasurement m;
  m.caRcb = (kMc.inverse() * kA.inverse() * kB * kMc).R * expSo3({0.1, 0.05, -0.1});
  m.direction = Eigen::Vector3d(0.5, 0.2, 0.8).normalized();
  const Matrix5d S = Matrix5d::Identity();
  Matrix56d J_a, J_b;
  residual(m, S, kMc, kA, kB, &J_a, &J_b);
  expectDerivative([&](const VectorXd &d) { return residual(m, S, kMc, kA.plus(d), kB, nullptr, nullptr); }, J_a);
  expectDerivative([&](const VectorXd &d) { return residual(m, S, kMc, kA, kB.plus(d), nullptr, nullptr); }, J_b);
}

TEST(Factors, ARelativePoseEqualToThePredictionHasNoResidual)
{
  const Pose caMcb = kMc.inverse() * kA.inverse() * kB * kMc;
  RelativePoseMeasurement m;
  m.caRcb = caMcb.R;
  m.direction = caMcb.t.normalized();
  EXPECT_LT(residual(m, Matrix5d::Identity(), kMc, kA, kB, nullptr, nullptr).norm(), 1e-9);
}

TEST(Factors, PosePriorJacobianAgreesWithDifferences)
{
  const PosePrior prior = {kA, Matrix6d::Identity()};
  const Matrix6d S = Matrix6d::Identity();
  Matrix6d J;
  residual(prior, S, kB, &J);
  expectDerivative([&](const VectorXd &d) { return residual(prior, S, kB.plus(d), nullptr); }, J);
}

TEST(Factors, SummaryJacobiansAgreeWithDifferences)
{
  Trunk trunk;
  trunk.xy << 6, 4;
  trunk.lean << 0.05, -0.03;
  SummaryFactor summary;
  summary.optimum = relativeTrunk(kA, kMc, trunk).plus(Vector4d(0.1, -0.1, 0.2, 0.3));
  summary.F << 5, 1, 0, 0, 1, 4, 0, 0, 0, 0, 3, 1, 0, 0, 1, 2;
  summary.f << 0.1, 0.2, -0.1, 0.3;
  SquareRootSummary root;
  ASSERT_EQ(squareRoot(summary, root), SummaryStatus::ok);
  Matrix46d J_pose;
  Matrix45d J_trunk;
  residual(root, kMc, kA, trunk, &J_pose, &J_trunk);
  expectDerivative([&](const VectorXd &d) { return residual(root, kMc, kA.plus(d), trunk, nullptr, nullptr); }, J_pose);
  expectDerivative([&](const VectorXd &d) { return residual(root, kMc, kA, trunk.plus(d), nullptr, nullptr); },
                   J_trunk);
}

TEST(Losses, WeightIsTheDerivativeOfRhoAndNeverRises)
{
  for (const LossKind kind : {LossKind::quadratic, LossKind::huber, LossKind::cauchy}) {
    const Loss loss = {kind, 2};
    EXPECT_EQ(loss.rho(0), 0);
    EXPECT_EQ(loss.weight(0), 1);
    EXPECT_EQ(lossKindFromString(toString(kind)), kind);
    double last = 1;
    for (double s = 0.5; s < 50; s *= 1.7) {
      EXPECT_NEAR((loss.rho(s + 1e-5) - loss.rho(s - 1e-5)) / 2e-5, loss.weight(s), 1e-6);
      EXPECT_LE(loss.weight(s), last);
      last = loss.weight(s);
    }
  }
  EXPECT_THROW(lossKindFromString("tukey"), vpException);
}
} // namespace
