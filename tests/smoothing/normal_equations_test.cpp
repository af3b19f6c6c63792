// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "smoothing/normal_equations.h"

using namespace bole;

namespace
{
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A chain with some loops of variables of many sizes, as quadratics on pairs, and the same as one dense system.
struct Chain
{
  explicit Chain(unsigned seed) : random(seed)
  {
    for (int v = 0; v < 14; ++v)
      dims.push_back(std::vector<int>{6, 5, 15, 1}[static_cast<std::size_t>(v % 4)]);
    equations = std::make_unique<NormalEquations>(dims);
    size = equations->offset(13) + dims[13];
    H = MatrixXd::Zero(size, size);
    g = VectorXd::Zero(size);
    for (int v = 0; v < 13; ++v)
      couple({v, v + 1});
    couple({9, 2});
    couple({0, 12, 5});
  }
  void couple(const std::vector<int> &variables)
  {
    std::normal_distribution<double> normal;
    int n = 0;
    for (const int v : variables)
      n += dims[v];
    MatrixXd A(n, n);
    VectorXd b(n);
    for (int i = 0; i < n; ++i) {
      b(i) = normal(random);
      for (int j = 0; j < n; ++j)
        A(i, j) = normal(random);
    }
    const MatrixXd own = A.transpose() * A + MatrixXd::Identity(n, n);
    equations->add(variables, own, b);
    int r = 0;
    for (const int row : variables) {
      int c = 0;
      for (const int column : variables) {
        H.block(equations->offset(row), equations->offset(column), dims[row], dims[column]) +=
            own.block(r, c, dims[row], dims[column]);
        c += dims[column];
      }
      g.segment(equations->offset(row), dims[row]) += b.segment(r, dims[row]);
      r += dims[row];
    }
  }

  std::mt19937 random;
  std::vector<int> dims;
  std::unique_ptr<NormalEquations> equations;
  int size = 0;
  MatrixXd H;
  VectorXd g;
};

std::vector<int> shuffled(Chain &chain)
{
  std::vector<int> order(chain.dims.size());
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), chain.random);
  return order;
}

TEST(NormalEquations, AreSolvedInAnyOrder)
{
  for (unsigned seed = 0; seed < 8; ++seed) {
    Chain chain(seed);
    const std::vector<int> order = seed % 2 ? shuffled(chain) : chain.equations->orderOfLittleFill();
    chain.equations->plan(order, seed % 3 ? 0 : 4);
    EXPECT_EQ(chain.equations->factorise(), 0);
    const VectorXd x = chain.H.llt().solve(chain.g);
    EXPECT_LT((chain.equations->solve() - x).norm(), 1e-9 * x.norm()) << seed;
    EXPECT_NEAR(chain.equations->decrease(), 0.5 * x.dot(chain.g), 1e-9 * std::abs(x.dot(chain.g))) << seed;
    MatrixXd damped = chain.H;
    damped.diagonal() *= 1.5;
    chain.equations->factorise(0.5);
    const VectorXd y = damped.llt().solve(chain.g);
    EXPECT_LT((chain.equations->solve() - y).norm(), 1e-9 * y.norm()) << seed;
  }
}

TEST(NormalEquations, TheirInverseIsKnownWhereAFactorCouples)
{
  for (unsigned seed = 0; seed < 4; ++seed) {
    Chain chain(seed);
    const NormalEquations &equations = *chain.equations;
    chain.equations->plan(shuffled(chain), seed % 2 ? 3 : 0);
    chain.equations->factorise();
    const MatrixXd C = chain.H.inverse();
    std::set<std::pair<int, int>> known;
    equations.sparseInverse([&](const std::vector<int> &variables, const MatrixXd &some) {
      int r = 0;
      for (const int a : variables) {
        int c = 0;
        for (const int b : variables) {
          known.emplace(a, b);
          const MatrixXd expected = C.block(equations.offset(a), equations.offset(b), chain.dims[a], chain.dims[b]);
          EXPECT_LT((some.block(r, c, chain.dims[a], chain.dims[b]) - expected).norm(), 1e-9 * C.norm());
          c += chain.dims[b];
        }
        r += chain.dims[a];
      }
    });
    for (const std::pair<int, int> &pair : {std::pair{0, 0}, {13, 13}, {3, 4}, {9, 2}, {12, 0}, {5, 0}})
      EXPECT_EQ(known.count(pair), 1u) << pair.first << " " << pair.second;
    MatrixXd X = MatrixXd::Random(3, chain.dims[1]), Y = MatrixXd::Random(3, chain.dims[10]), whole(3, chain.size);
    whole.setZero();
    whole.middleCols(equations.offset(1), chain.dims[1]) = X;
    whole.middleCols(equations.offset(10), chain.dims[10]) = Y;
    EXPECT_TRUE(equations.covariance({{1, X}, {10, Y}}).isApprox(whole * C * whole.transpose(), 1e-9));
  }
}

TEST(NormalEquations, WhatIsEliminatedLeavesASchurComplement)
{
  Chain chain(1);
  const std::vector<int> order = shuffled(chain);
  chain.equations->plan(order, 3);
  MatrixXd H;
  VectorXd g;
  chain.equations->schur(H, g);
  std::vector<int> last;
  for (std::size_t i = order.size() - 3; i < order.size(); ++i)
    for (int k = 0; k < chain.dims[order[i]]; ++k)
      last.push_back(chain.equations->offset(order[i]) + k);
  const MatrixXd C = chain.H.inverse();
  const VectorXd x = C * chain.g;
  MatrixXd expected(last.size(), last.size());
  VectorXd there(last.size());
  for (std::size_t i = 0; i < last.size(); ++i) {
    there(static_cast<Eigen::Index>(i)) = x(last[i]);
    for (std::size_t j = 0; j < last.size(); ++j)
      expected(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = C(last[i], last[j]);
  }
  EXPECT_TRUE(H.inverse().isApprox(expected, 1e-8));
  EXPECT_TRUE(H.llt().solve(g).isApprox(there, 1e-8));
}

TEST(NormalEquations, HoldADirectionThatNothingIsKnownOf)
{
  NormalEquations equations({3, 2});
  equations.add<1, 3>(0, Eigen::RowVector3d(1, 0, 0), Eigen::Matrix<double, 1, 1>(-2));
  equations.add<2, 2>(1, Eigen::Matrix2d::Identity(), Eigen::Vector2d(1, 1));
  equations.plan({0, 1});
  EXPECT_EQ(equations.factorise(), 2);
  EXPECT_TRUE(equations.solve().isApprox((VectorXd(5) << 2, 0, 0, -1, -1).finished()));
}
} // namespace
