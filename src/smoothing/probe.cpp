// SPDX-License-Identifier: GPL-2.0-or-later
// Whether the linearisation still holds where the estimates are by now.
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
namespace
{
constexpr double kWeightShare = 0.2;
constexpr double kLargestTurn = 0.045;    ///< [rad] of a pose against its point, however common
constexpr std::size_t kFactorsProbed = 6; ///< of a trunk, newest to oldest, for their linearisation error
} // namespace

/// Whitened residual that the linearisation predicts at the estimates.
Vector6d Smoother::State::linearPrediction(Factor &factor)
{
  const bool is_old = factor.linear == nullptr;
  if (is_old)
    linearise(factor);
  const int rows = rowCount(factor.kind);
  Vector6d r = Vector6d::Zero();
  const double *column = factor.linear.get();
  for (const int v : {factor.a, factor.b}) {
    if (v < 0)
      continue;
    for (int c = 0; c < variables[v].dim; ++c, column += rows)
      for (int i = 0; i < rows; ++i)
        r(i) += column[i] * variables[v].delta(c);
  }
  for (int i = 0; i < rows; ++i)
    r(i) -= column[i];
  if (is_old)
    factor.linear.reset();
  return r;
}

namespace
{
/// Weight of a loss where it is \p rho.
double weightAt(const Loss &loss, double rho)
{
  switch (loss.kind) {
  case LossKind::quadratic:
    return 1;
  case LossKind::huber:
    return loss.width / std::max(loss.width, 0.5 * (rho / loss.width + loss.width));
  case LossKind::cauchy:
    return std::exp(-rho / (loss.width * loss.width));
  }
  return 1;
}

/// Linearisation error of a weighted residual: the part by the curvature of the geometry, and a share of the part by a
/// weight that no longer fits. A wrong weight only makes the loss a little softer or harder.
template <int N>
double modelError(const Loss &loss, double cost, const Eigen::Matrix<double, N, 1> &r,
                  const Eigen::Matrix<double, N, 1> &predicted)
{
  const double root = std::sqrt(weightAt(loss, 2 * cost));
  const double now = std::sqrt(loss.weight(r.squaredNorm()));
  return std::max((root * r - predicted).norm(), kWeightShare * std::abs(now - root) * r.norm());
}
} // namespace

/// How far, in standard deviations, the true residual at the estimates is from its linear model.
double Smoother::State::linearisationError(Factor &factor)
{
  if (factor.stale)
    return 0;
  if (factor.kind == FactorKind::observation) {
    const Vector4d r = residual(observations[factor.data], options.bMc, estimate(poses[variables[factor.a].number]),
                                estimate(trunks[variables[factor.b].number]), nullptr, nullptr);
    return modelError<4>(options.summary_loss, factor.cost, r, linearPrediction(factor).head<4>());
  }
  if (factor.kind == FactorKind::odometry) {
    const Odometry &data = odometry[factor.data];
    const Vector6d r = residual(data, squareRootInformation(data), estimate(poses[variables[factor.a].number]),
                                estimate(poses[variables[factor.b].number]), nullptr, nullptr);
    return (r - linearPrediction(factor)).norm();
  }
  if (factor.kind == FactorKind::relative_pose) {
    const RelativePoseMeasurement &data = relative_poses[factor.data];
    const Vector5d r =
        residual(data, squareRootInformation(data), options.bMc, estimate(poses[variables[factor.a].number]),
                 estimate(poses[variables[factor.b].number]), nullptr, nullptr);
    return modelError<5>(options.direction_loss, factor.cost, r, linearPrediction(factor).head<5>());
  }
  return 0;
}

/// The largest part of \p step, in thresholds of relinearisation.
double Smoother::State::inThresholds(const Variable &variable, const Vector6d &step) const
{
  const double moved_by = step.head(variable.is_pose ? 3 : 2).cwiseAbs().maxCoeff();
  const double rest = variable.is_pose ? step.tail<3>().cwiseAbs().maxCoeff() / options.relinearise_rotation
                                       : std::max(std::abs(step(2)) / options.relinearise_log_radius,
                                                  step.segment<2>(3).cwiseAbs().maxCoeff() / options.relinearise_lean);
  return std::max(moved_by / options.relinearise_position, rest);
}

/// The displacement from the linearisation point to the estimate [m]; of a trunk at the height from which it was last
/// seen.
Eigen::Vector3d Smoother::State::displacement(const Variable &variable) const
{
  if (variable.is_pose)
    return poses[variable.number].point.R * variable.delta.head<3>();
  const TrunkState &trunk = trunks[variable.number];
  const PoseState &seen_from = poses[trunk.last_pose];
  const double z = estimate(seen_from).t.z(), before = seen_from.point.t.z();
  return trunk.point.plus(variable.delta.head<5>()).axisAt(z) - trunk.point.axisAt(before);
}

/// The displacement relative to the next variable eliminated, since a shift common to a whole stretch bends no factor.
Eigen::Vector3d Smoother::State::ownDisplacement(const Variable &variable) const
{
  const Eigen::Vector3d own = displacement(variable);
  return variable.parent < 0 ? own : Eigen::Vector3d(own - displacement(variables[variable.parent]));
}

/// The step of the estimate since the linearisation of its factors was last found good.
Vector6d Smoother::State::ownStep(const Variable &variable) const
{
  Vector6d step = variable.delta - variable.probed;
  const Eigen::Vector3d shift = ownDisplacement(variable) - variable.probed_displacement;
  const int count = variable.is_pose ? 3 : 2;
  step.head(count) = shift.head(count);
  return step;
}

void Smoother::State::rememberProbe(Variable &variable) const
{
  variable.probed = variable.delta;
  variable.probed_displacement = ownDisplacement(variable);
}

/// Probes the factors only where the estimate has moved on since they were last found good. Pose
/// priors are linear enough never to ask for more than their pose's own factors do.
bool Smoother::State::needsRelinearisation(Variable &variable)
{
  if (inThresholds(variable, ownStep(variable)) <= 1)
    return false;
  // A common shift changes no view; a common turn does, to second order.
  if (variable.is_pose && variable.delta.tail<3>().norm() > kLargestTurn)
    return true;
  bool all = true; // both ends as of now: else what looks bent is one end left behind
  const auto isWhole = [&](const Factor &factor) {
    const bool whole =
        variables[factor.a].visited + 1 >= passes && (factor.b < 0 || variables[factor.b].visited + 1 >= passes);
    all = all && whole;
    return whole;
  };
  const std::size_t count = variable.factors.size();
  const std::size_t every = variable.is_pose ? 1 : std::max<std::size_t>(1, count / kFactorsProbed);
  for (std::size_t i = 0; i < count; i += every) {
    Factor &factor = factors[variable.factors[count - 1 - i]];
    if (isWhole(factor) && linearisationError(factor) > options.linearisation_tolerance)
      return true;
  }
  if (all)
    rememberProbe(variable);
  return false;
}
} // namespace bole
