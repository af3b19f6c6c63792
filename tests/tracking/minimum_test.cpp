// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/minimum.h"

#include <gtest/gtest.h>
#include <nlopt.h>

#include <limits>
#include <random>

namespace
{
using namespace bole;

/// Two blurred steps, each seen at the two ends of a line, and a weak prior on two of the four numbers: what tracking
/// minimises.
struct TwoBorders
{
  explicit TwoBorders(unsigned seed)
  {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(-1.2, 1.2), slope(-0.3, 0.3);
    for (int i = 0; i < 4; ++i) {
      at(i) = place(random);
      const double along = i % 2 == 0 ? 1 : -1, side = i < 2 ? 1 : -1;
      by_x.row(i) << along, 0.2 * side + slope(random), 1 + slope(random), side;
    }
  }
  double operator()(const Vector4d &x, Vector4d *g) const
  {
    const Vector4d off = by_x * x - at;
    const Vector4d depth = 0.5 * (-0.5 * off.cwiseAbs2()).array().exp();
    const Vector4d held(0.1, 0.1, 0, 0);
    *g = by_x.transpose() * depth.cwiseProduct(off) + held.cwiseProduct(x);
    return 0.5 * held.dot(x.cwiseAbs2()) - depth.sum();
  }

  Vector4d at;
  Matrix4d by_x;
};

double callTwoBorders(unsigned, const double *x, double *gradient, void *data)
{
  Vector4d g;
  const double value = (*static_cast<const TwoBorders *>(data))(Vector4d(x), &g);
  if (gradient)
    Vector4d::Map(gradient) = g;
  return value;
}

Vector4d minimumByNlopt(TwoBorders borders)
{
  Vector4d x = Vector4d::Zero();
  const Vector4d bound = Vector4d::Constant(6), opposite = -bound;
  nlopt_opt optimiser = nlopt_create(NLOPT_LD_SLSQP, 4);
  nlopt_set_min_objective(optimiser, callTwoBorders, &borders);
  nlopt_set_lower_bounds(optimiser, opposite.data());
  nlopt_set_upper_bounds(optimiser, bound.data());
  nlopt_set_xtol_abs1(optimiser, 1e-6);
  double value = 0;
  nlopt_optimize(optimiser, x.data(), &value);
  nlopt_destroy(optimiser);
  return x;
}

TEST(Minimum, IsTheOneThatNloptFinds)
{
  int same = 0, evaluations = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const TwoBorders borders(seed);
    Vector4d x = Vector4d::Zero();
    const auto counted = [&](const Vector4d &at, Vector4d *g) {
      ++evaluations;
      return borders(at, g);
    };
    const Matrix4d H = 0.5 * borders.by_x.transpose() * borders.by_x + 1e-3 * Matrix4d::Identity();
    EXPECT_TRUE(findMinimum(counted, H, x));
    same += (x - minimumByNlopt(borders)).norm() < 0.02;
  }
  EXPECT_GE(same, 95); // from some starts two minima are as near
  EXPECT_LT(evaluations, 100 * 12);
}

TEST(Minimum, IsFoundFromAnyPositiveHessian)
{
  for (const double guess : {0.1, 1.0, 10.0}) {
    const auto bowl = [](const Vector4d &x, Vector4d *g) {
      const Vector4d centre(1, -2, 0.5, 0), weight(1, 3, 0.3, 10), off = x - centre;
      *g = weight.cwiseProduct(off);
      return 0.5 * weight.dot(off.cwiseAbs2());
    };
    Vector4d x = Vector4d::Zero();
    EXPECT_TRUE(findMinimum(bowl, guess * Matrix4d::Identity(), x));
    EXPECT_LT((x - Vector4d(1, -2, 0.5, 0)).norm(), 0.02) << guess;
  }
}

TEST(Minimum, StaysWithinItsBounds)
{
  const auto slope = [](const Vector4d &x, Vector4d *g) {
    *g = Vector4d(1, -1, 0, 2 * x(3));
    return x(0) - x(1) + x(3) * x(3);
  };
  Vector4d x(0, 0, 0.5, 1);
  EXPECT_TRUE(findMinimum(slope, Matrix4d::Identity(), x));
  EXPECT_LT((x - Vector4d(-6, 6, 0.5, 0)).norm(), 1e-2) << x.transpose();
}

TEST(Minimum, IsNoneWhereTheFunctionIsNotFinite)
{
  const auto nothing = [](const Vector4d &, Vector4d *g) {
    g->setZero();
    return std::numeric_limits<double>::quiet_NaN();
  };
  Vector4d x = Vector4d::Zero();
  EXPECT_FALSE(findMinimum(nothing, Matrix4d::Identity(), x));
}
} // namespace
