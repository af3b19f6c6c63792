// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Derivatives by central differences.

#include "support/test.h"

namespace bole::test
{
using Function = std::function<Eigen::VectorXd(const Eigen::VectorXd &)>;

/// Of \p f at 0, by each of its \p n unknowns.
inline Eigen::MatrixXd differences(const Function &f, Eigen::Index n, double step)
{
  Eigen::MatrixXd J(f(Eigen::VectorXd::Zero(n)).size(), n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd xi = step * Eigen::VectorXd::Unit(n, i);
    J.col(i) = (f(xi) - f(-xi)) / (2 * step);
  }
  return J;
}

/// \p J is the derivative of \p f at 0: what differences err by is at most \p most, and falls with the square of the
/// step.
inline void expectDerivative(const Function &f, const Eigen::MatrixXd &J, double step, double most)
{
  const double coarse = (differences(f, J.cols(), step) - J).norm();
  EXPECT_LT(coarse, most);
  if (coarse > 1e-8) {
    EXPECT_NEAR(coarse / (differences(f, J.cols(), step / 2) - J).norm(), 4, 0.2);
  }
}
} // namespace bole::test
