// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/odds/logistic.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace bole
{
namespace
{
double probability(double log_odds) { return 1 / (1 + std::exp(-std::clamp(log_odds, -30.0, 30.0))); }
} // namespace

Eigen::VectorXd fitLogistic(const Eigen::MatrixXd &terms, const Eigen::VectorXd &truth)
{
  constexpr int kIterations = 20;
  const Eigen::Index n = terms.cols();
  Eigen::VectorXd w = Eigen::VectorXd::Zero(n), prior = Eigen::VectorXd::Ones(n);
  prior(n - 1) = 1e-6;
  for (int i = 0; i < kIterations; ++i) {
    const Eigen::VectorXd p = (terms * w).unaryExpr(&probability);
    const Eigen::VectorXd gradient = terms.transpose() * (truth - p) - prior.cwiseProduct(w);
    Eigen::MatrixXd H = terms.transpose() * p.cwiseProduct(Eigen::VectorXd::Ones(p.size()) - p).asDiagonal() * terms;
    H.diagonal() += prior;
    w += H.ldlt().solve(gradient);
  }
  return w;
}

std::vector<ReliabilityBin> reliability(const Eigen::VectorXd &log_odds, const Eigen::VectorXd &truth, int bins)
{
  std::vector<ReliabilityBin> all(static_cast<std::size_t>(bins));
  for (Eigen::Index i = 0; i < log_odds.size(); ++i) {
    const double p = probability(log_odds(i));
    ReliabilityBin &bin = all[static_cast<std::size_t>(std::min(bins - 1, static_cast<int>(p * bins)))];
    ++bin.count;
    bin.said += (p - bin.said) / bin.count;
    bin.was += (truth(i) - bin.was) / bin.count;
  }
  all.erase(std::remove_if(all.begin(), all.end(), [](const ReliabilityBin &bin) { return bin.count == 0; }),
            all.end());
  return all;
}

double areaUnderRoc(const Eigen::VectorXd &log_odds, const Eigen::VectorXd &truth)
{
  std::vector<Eigen::Index> order(static_cast<std::size_t>(log_odds.size()));
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return log_odds(a) < log_odds(b); });
  double rank = 0, sum = 0, positives = 0;
  for (const Eigen::Index i : order) {
    rank += 1;
    sum += truth(i) * rank;
    positives += truth(i);
  }
  return (sum - positives * (positives + 1) / 2) / (positives * (rank - positives));
}
} // namespace bole
