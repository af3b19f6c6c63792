// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/names.h"
#include "geometry/so3.h"
#include "summary/square_root.h"

#include <Eigen/Eigenvalues>

namespace bole
{
double SummaryFactor::energyAt(const RelativeTrunk &relative) const
{
  const Vector4d d = relative.minus(optimum);
  return energy + f.dot(d) + 0.5 * d.dot(F * d); // Eq. 9
}

const char *toString(SummaryStatus status) { return nameOf(status, {"ok", "projected", "indefinite", "not finite"}); }

Vector4d SquareRootSummary::residual(const RelativeTrunk &relative, Matrix4d *J) const
{
  const Vector4d d = relative.minus(optimum);
  if (J) {
    J->leftCols<3>() = S.leftCols<3>() * inverseRightJacobianSo3(d.head<3>());
    J->col(3) = S.col(3);
  }
  return S * d + b;
}

SummaryFactor SquareRootSummary::factor() const
{
  SummaryFactor factor;
  factor.optimum = optimum;
  factor.energy = constant + 0.5 * b.squaredNorm();
  factor.f = S.transpose() * b;
  factor.F = S.transpose() * S;
  return factor;
}

SummaryStatus squareRoot(const SummaryFactor &factor, SquareRootSummary &root)
{
  const RelativeTrunk &x = factor.optimum;
  if (!x.isFinite() || !factor.f.allFinite() || !factor.F.allFinite() || !std::isfinite(factor.energy) ||
      !(x.cRt.transpose() * x.cRt).isApprox(Eigen::Matrix3d::Identity(), 1e-5) || x.cRt.determinant() < 0)
    return SummaryStatus::not_finite;
  const Matrix4d F = 0.5 * (factor.F + factor.F.transpose());
  const Eigen::SelfAdjointEigenSolver<Matrix4d> eigen(F);
  const Vector4d &lambda = eigen.eigenvalues();
  const double largest = lambda(3);
  if (lambda(0) < 0 && lambda(0) < -kIndefiniteTolerance * largest)
    return SummaryStatus::indefinite;

  root.optimum = x;
  root.constant = factor.energy;
  root.S.setZero();
  root.b.setZero();
  for (int i = 0; i < 4; ++i) {
    if (lambda(i) <= kRankTolerance * largest)
      continue;
    const double along = eigen.eigenvectors().col(i).dot(factor.f);
    root.S.row(i) = std::sqrt(lambda(i)) * eigen.eigenvectors().col(i).transpose();
    root.b(i) = along / std::sqrt(lambda(i));
    root.constant -= 0.5 * along * along / lambda(i);
  }
  return lambda(0) < -kRankTolerance * largest ? SummaryStatus::projected : SummaryStatus::ok;
}
} // namespace bole
