// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The minimum of a smooth function of four numbers near its start, with bounds: quasi-Newton steps (BFGS, damped as
/// Powell does, so that the Hessian stays positive) that are halved until the function falls enough.
///
/// A Hessian that is known roughly from what borders look like saves half of the evaluations.

#include <bole/trunk.h>

#include <algorithm>
#include <cmath>

namespace bole
{
struct MinimumOptions
{
  double bound = 6;      ///< of each number
  double settled = 2e-3; ///< a step that is smaller in each number is the last
  int evaluations = 40;  ///< at most
};

/// \p function(x, &gradient) gives value and gradient; \p H: its Hessian, positive, roughly. From \p x on; false where
/// the function is not finite.
template <class Function>
bool findMinimum(const Function &function, Matrix4d H, Vector4d &x, const MinimumOptions &options = {})
{
  constexpr double kEnough = 1e-4; // of what the slope promises
  constexpr double kCurved = 0.2;  // of the curvature that was expected: less is no news of the Hessian
  Vector4d g;
  double value = function(x, &g);
  for (int evaluation = 1; evaluation < options.evaluations && std::isfinite(value) && g.allFinite();) {
    Matrix4d free_H = H; // without what its bound holds
    Vector4d free_g = g;
    for (int i = 0; i < 4; ++i)
      if (g(i) > 0 ? x(i) <= -options.bound : x(i) >= options.bound) {
        free_H.row(i).setZero();
        free_H.col(i).setZero();
        free_H(i, i) = 1;
        free_g(i) = 0;
      }
    const Vector4d wanted = x - free_H.llt().solve(free_g);
    Vector4d step = wanted.cwiseMax(-options.bound).cwiseMin(options.bound) - x;
    const double slope = g.dot(step);
    if (!(slope < 0))
      break;
    Vector4d g_there;
    double there = 0;
    bool is_settled = false;
    for (double share = 1;; share *= 0.5, step *= 0.5) {
      is_settled = step.lpNorm<Eigen::Infinity>() < options.settled;
      there = function(x + step, &g_there);
      if (++evaluation >= options.evaluations || there <= value + kEnough * share * slope)
        break;
      if (is_settled)
        return true;
    }
    if (!(there <= value))
      return std::isfinite(value);
    const Vector4d expected = H * step, found = g_there - g;
    const double curvature = step.dot(expected), seen = step.dot(found);
    const double trust = seen >= kCurved * curvature ? 1 : (1 - kCurved) * curvature / (curvature - seen);
    const Vector4d y = trust * found + (1 - trust) * expected;
    H += y * y.transpose() / step.dot(y) - expected * expected.transpose() / curvature;
    x += step;
    value = there;
    g = g_there;
    if (is_settled)
      break;
  }
  return std::isfinite(value) && g.allFinite();
}
} // namespace bole
