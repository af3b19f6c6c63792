// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Logistic regression: weights w so that 1 / (1 + exp(-w x)) is the probability of what was true.

#include <Eigen/Core>

#include <vector>

namespace bole
{
/// The maximum of the likelihood of \p truth (0 or 1, one for each row of \p terms) less half of the squared weights,
/// which keeps terms that decide nothing small; Newton's method. The last column is the constant: it is free.
Eigen::VectorXd fitLogistic(const Eigen::MatrixXd &terms, const Eigen::VectorXd &truth);

/// One bin of a reliability diagram.
struct ReliabilityBin
{
  double said = 0; ///< mean probability
  double was = 0;  ///< share that was true
  int count = 0;
};
/// Bins of equal width in the probability; empty ones are left out.
std::vector<ReliabilityBin> reliability(const Eigen::VectorXd &log_odds, const Eigen::VectorXd &truth, int bins = 10);

/// Probability that a true one has higher log-odds than a false one: the area under the ROC curve.
double areaUnderRoc(const Eigen::VectorXd &log_odds, const Eigen::VectorXd &truth);
} // namespace bole
