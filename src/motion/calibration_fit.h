// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Robust least squares over a few constants of a sensor, for the calibration.

#include "geometry/constants.h"
#include "geometry/median.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace bole::calibration
{
inline constexpr double kMostLate_s = 0.15, kLateStep_s = 0.01; ///< offsets of a clock that are tried
inline constexpr int kLateSteps = 15;
inline constexpr double kWideBias = 0.1; ///< of the wide part of the prior [rad/s]
inline constexpr double kMount = 0.017;  ///< of the narrow part of the prior on the odometry's attitude [rad]
inline constexpr double kBetter = 16; ///< by which twice the log of the likelihood must grow: four standard deviations
inline constexpr double kMostFailing = 0.15; ///< of the measurements: more, and the constants do not explain the sensor
inline constexpr double kSoft = 9;           ///< squared error over its variance from which a measurement loses its say
inline constexpr double kFails = 30;         ///< ... at which it contradicts what was fitted

inline double soft(double squares) { return kSoft * std::log1p(squares / kSoft); }
inline double weightFor(double squares) { return 1 / (1 + squares / kSoft); }

/// A least squares fit of P unknowns.
template <int P> struct FittedOf
{
  double cost = 0; ///< robust, counting what overlaps once
  Eigen::Matrix<double, P, 1> value = Eigen::Matrix<double, P, 1>::Zero();
  Eigen::Matrix<double, P, P> covariance = Eigen::Matrix<double, P, P>::Zero();
  double failing = 1; ///< share of the measurements that contradict it
  double scatter = 1; ///< variance of what is left over what it should be
};
using Fitted = FittedOf<3>;

/// Median of the squares of three normal errors each, over what it should be; at least 1.
inline double scatterOf(const std::vector<double> &squares) { return std::max(1.0, medianOf(squares) / 2.37); }

inline double failingOf(const std::vector<double> &squares)
{
  const auto failing = std::count_if(squares.begin(), squares.end(), [](double e2) { return e2 > kFails; });
  return squares.empty() ? 1 : double(failing) / double(squares.size());
}

/// A linear measurement r + J x of P unknowns with its information W.
template <int P> struct RowOf
{
  using Unknowns = Eigen::Matrix<double, P, 1>;
  /// \p J: by the first Q unknowns; the others have no part in it.
  template <int N, int Q>
  RowOf(const Eigen::Matrix<double, N, Q> &J, const Eigen::Matrix<double, N, 1> &r,
        const Eigen::Matrix<double, N, N> &W, double overlap_)
      : rWr(r.dot(W * r)), size(N), overlap(overlap_)
  {
    JWJ.template topLeftCorner<Q, Q>() = J.transpose() * W * J;
    JWr.template head<Q>() = J.transpose() * W * r;
  }
  /// Of what is left of it at \p x, as of three numbers.
  double squares(const Unknowns &x) const { return std::max(0.0, rWr + x.dot(2 * JWr + JWJ * x)) * 3 / size; }

  Eigen::Matrix<double, P, P> JWJ = Eigen::Matrix<double, P, P>::Zero();
  Unknowns JWr = Unknowns::Zero();
  double rWr = 0;
  int size = 3;
  double overlap = 1; ///< measurements that share what they measured
};
using Row = RowOf<3>;

/// Robust solution; \p prior2: variance of each unknown about 0, \p at: what the unknowns count from in the rows.
template <int P>
FittedOf<P> solve(const std::vector<RowOf<P>> &rows, const typename RowOf<P>::Unknowns &prior2, double scatter,
                  const typename RowOf<P>::Unknowns &at = RowOf<P>::Unknowns::Zero())
{
  FittedOf<P> fit;
  constexpr int kIterations = 6;
  std::vector<double> squares(rows.size());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix<double, P, P> H = prior2.cwiseInverse().asDiagonal();
    typename RowOf<P>::Unknowns g = at.cwiseQuotient(prior2);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const RowOf<P> &row = rows[i];
      const double w = (iteration == 0 ? 1 : weightFor(squares[i])) / row.overlap;
      H += w * row.JWJ;
      g += w * row.JWr;
    }
    fit.covariance = H.inverse();
    fit.value = -fit.covariance * g;
    for (std::size_t i = 0; i < rows.size(); ++i)
      squares[i] = rows[i].squares(fit.value);
  }
  fit.failing = failingOf(squares);
  fit.scatter = scatter > 0 ? scatter : scatterOf(squares);
  fit.covariance *= fit.scatter;
  for (std::size_t i = 0; i < rows.size(); ++i)
    fit.cost += soft(squares[i] / fit.scatter) / rows[i].overlap;
  return fit;
}
inline Fitted solve(const std::vector<Row> &rows, double prior2, double scatter = 0)
{
  return solve<3>(rows, Eigen::Vector3d::Constant(prior2), scatter);
}

/// A minimum over offsets of a clock, refined by a parabola.
struct Minimum
{
  double late_s = 0, sigma_s = 0, gain = 0; ///< gain: of the cost against no offset
  bool is_inside = false;
};

/// The scatter of \p fitAt(late_s, scatter) at the best offset of all: that of the noise.
template <typename FitAt> double leastScatter(const FitAt &fitAt)
{
  double best_s = 0, least = std::numeric_limits<double>::max();
  for (int k = -kLateSteps; k <= kLateSteps; ++k)
    if (const double cost = fitAt(kLateStep_s * k, 1).cost; cost < least) {
      least = cost;
      best_s = kLateStep_s * k;
    }
  return fitAt(best_s, 0).scatter;
}

template <typename Cost> Minimum minimiseLate(const Cost &cost)
{
  std::vector<double> costs;
  for (int k = -kLateSteps; k <= kLateSteps; ++k)
    costs.push_back(cost(kLateStep_s * k));
  const auto best = std::min_element(costs.begin(), costs.end());
  Minimum minimum;
  minimum.is_inside = best != costs.begin() && best + 1 != costs.end();
  if (!minimum.is_inside)
    return minimum;
  const double before = *(best - 1), after = *(best + 1), curvature = std::max(1e-9, before - 2 * *best + after);
  const double vertex = std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5);
  minimum.late_s = kLateStep_s * (double(best - costs.begin()) - kLateSteps + vertex);
  minimum.sigma_s = kLateStep_s * std::sqrt(2 / curvature);
  minimum.gain = costs[kLateSteps] - (*best - 0.5 * curvature * vertex * vertex);
  return minimum;
}
} // namespace bole::calibration
