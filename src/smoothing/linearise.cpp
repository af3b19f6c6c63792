// SPDX-License-Identifier: GPL-2.0-or-later
// From factors to whitened linear blocks, and the cost at the estimates.
#include "state.h"

#include <algorithm>

namespace bole
{
namespace
{
constexpr double kWeightShare = 0.2;
constexpr double kLargestShift = 8; ///< times the relinearisation thresholds
constexpr std::size_t kFactorsProbed =
    6; ///< of a trunk, newest to oldest, for their linearisation error

template <int Rows, int Columns> using Block = Eigen::Map<Eigen::Matrix<double, Rows, Columns>>;

/// Writes [J_a J_b -r] with the square root of the loss' weight; returns rho / 2.
template <int Rows, int A, int B>
double store2(const Loss &loss, const Eigen::Matrix<double, Rows, A> &J_a,
              const Eigen::Matrix<double, Rows, B> &J_b, const Eigen::Matrix<double, Rows, 1> &r,
              double *linear)
{
  const double s = r.squaredNorm();
  const double root = std::sqrt(loss.weight(s));
  Block<Rows, A>(linear).noalias() = root * J_a;
  Block<Rows, B>(linear + Rows * A).noalias() = root * J_b;
  Block<Rows, 1>(linear + Rows * (A + B)).noalias() = -root * r;
  return 0.5 * loss.rho(s);
}

template <int Rows, int A>
double store1(const Eigen::Matrix<double, Rows, A> &J, const Eigen::Matrix<double, Rows, 1> &r,
              double *linear)
{
  for (int c = 0; c < A; ++c)
    for (int i = 0; i < Rows; ++i)
      linear[c * Rows + i] = J(i, c);
  Block<Rows, 1>(linear + Rows * A) = -r;
  return 0.5 * r.squaredNorm();
}
} // namespace

void Smoother::State::linearise(Factor &factor)
{
  if (!factor.stale)
    constant_cost -= factor.cost;
  const auto pose = [this](int v) -> const Pose & { return poses[variables[v].number].point; };
  switch (factor.kind) {
  case FactorKind::pose_prior: {
    Matrix6d J;
    const PosePriorData &data = pose_priors[factor.data];
    const Vector6d r = residual(data.factor, data.S, pose(factor.a), &J);
    factor.cost = store1<6, 6>(J, r, factor.linear);
    break;
  }
  case FactorKind::odometry: {
    Matrix6d J_a, J_b;
    const OdometryData &data = odometry[factor.data];
    const Vector6d r = residual(data.factor, data.S, pose(factor.a), pose(factor.b), &J_a, &J_b);
    factor.cost = store2<6, 6, 6>(Loss(), J_a, J_b, r, factor.linear);
    break;
  }
  case FactorKind::relative_pose: {
    Matrix56d J_a, J_b;
    const RelativePoseData &data = relative_poses[factor.data];
    const Vector5d r =
        residual(data.factor, data.S, options.bMc, pose(factor.a), pose(factor.b), &J_a, &J_b);
    factor.cost = store2<5, 6, 6>(options.direction_loss, J_a, J_b, r, factor.linear);
    break;
  }
  case FactorKind::height: {
    Matrix16d J;
    const Vector1d r(residual(heights[factor.data], pose(factor.a), &J));
    factor.cost = store1<1, 6>(J, r, factor.linear);
    break;
  }
  case FactorKind::observation: {
    Matrix46d J_pose;
    Matrix45d J_trunk;
    const Vector4d r = residual(observations[factor.data].root, options.bMc, pose(factor.a),
                                trunks[variables[factor.b].number].point, &J_pose, &J_trunk);
    factor.cost = store2<4, 6, 5>(options.summary_loss, J_pose, J_trunk, r, factor.linear);
    break;
  }
  case FactorKind::marginal: {
    MarginalData &data = marginals[factor.data];
    Eigen::VectorXd xi(data.g.size());
    int row = 0;
    for (std::size_t i = 0; i < data.variables.size(); ++i) {
      const Variable &v = variables[data.variables[i]];
      if (v.is_pose)
        xi.segment<6>(row) = poses[v.number].point.minus(data.poses[i]);
      else
        xi.segment<5>(row) = trunks[v.number].point.minus(data.trunks[i]);
      row += v.dim;
    }
    data.g = data.g_there - data.H * xi;
    factor.cost = 0.5 * xi.dot(data.H * xi) - data.g_there.dot(xi);
    break;
  }
  }
  constant_cost += factor.cost;
  factor.stale = false;
}

double Smoother::State::costAtEstimate(const Factor &factor) const
{
  const auto pose = [this](int v) { return estimate(poses[variables[v].number]); };
  switch (factor.kind) {
  case FactorKind::pose_prior: {
    const PosePriorData &data = pose_priors[factor.data];
    return 0.5 * residual(data.factor, data.S, pose(factor.a), nullptr).squaredNorm();
  }
  case FactorKind::odometry: {
    const OdometryData &data = odometry[factor.data];
    return 0.5 * residual(data.factor, data.S, pose(factor.a), pose(factor.b), nullptr, nullptr)
                     .squaredNorm();
  }
  case FactorKind::relative_pose: {
    const RelativePoseData &data = relative_poses[factor.data];
    const Vector5d r = residual(data.factor, data.S, options.bMc, pose(factor.a), pose(factor.b),
                                nullptr, nullptr);
    return 0.5 * options.direction_loss.rho(r.squaredNorm());
  }
  case FactorKind::height: {
    const double r = residual(heights[factor.data], pose(factor.a), nullptr);
    return 0.5 * r * r;
  }
  case FactorKind::observation: {
    const Vector4d r = residual(observations[factor.data].root, options.bMc, pose(factor.a),
                                estimate(trunks[variables[factor.b].number]), nullptr, nullptr);
    return 0.5 * options.summary_loss.rho(r.squaredNorm());
  }
  case FactorKind::marginal: {
    const MarginalData &data = marginals[factor.data];
    Eigen::VectorXd xi(data.g.size());
    int row = 0;
    for (std::size_t i = 0; i < data.variables.size(); ++i) {
      const Variable &v = variables[data.variables[i]];
      if (v.is_pose)
        xi.segment<6>(row) = estimate(poses[v.number]).minus(data.poses[i]);
      else
        xi.segment<5>(row) = estimate(trunks[v.number]).minus(data.trunks[i]);
      row += v.dim;
    }
    return 0.5 * xi.dot(data.H * xi) - data.g_there.dot(xi);
  }
  }
  return 0;
}

double Smoother::State::costAtEstimate() const
{
  double sum = 0;
  for (const Factor &factor : factors)
    if (factor.alive)
      sum += costAtEstimate(factor);
  for (const TrunkState &trunk : trunks)
    if (!trunk.removed && isOpen(trunk.variable))
      sum += 0.5 * residual(trunk.prior, estimate(trunk)).squaredNorm();
  return sum;
}

Pose Smoother::State::estimate(const PoseState &pose) const
{
  return isOpen(pose.variable) ? pose.point.plus(variables[pose.variable].delta) : pose.point;
}

Trunk Smoother::State::estimate(const TrunkState &trunk) const
{
  if (!isOpen(trunk.variable))
    return trunk.point;
  const Vector5d step = variables[trunk.variable].delta.head<5>();
  return trunk.point.plus(limitedTrunkStep(trunk, step));
}

/// A step that would throw a trunk across the camera, or change its radius manyfold, is outside
/// what the linearisation knows: only part of it is taken, and the rest found anew from there.
Vector5d Smoother::State::limitedTrunkStep(const TrunkState &trunk, const Vector5d &step) const
{
  const double move = step.head<2>().norm();
  const double resize = std::abs(step(2));
  if (move < 0.1 && resize < 0.5)
    return step;
  double distance = 10;
  if (!poses.empty())
    distance = (poses[trunk.last_pose].point.t.head<2>() - trunk.point.xy).norm();
  const double limit = std::max(0.1, 0.5 * distance);
  return step * std::min({1.0, limit / std::max(move, 1e-9), 0.7 / std::max(resize, 1e-9)});
}

/// Whitened residual that the linearisation predicts at the estimates.
Vector6d Smoother::State::linearPrediction(const Factor &factor) const
{
  const int rows = rowCount(factor.kind);
  Vector6d r = Vector6d::Zero();
  const double *column = factor.linear;
  for (const int v : {factor.a, factor.b}) {
    if (v < 0)
      continue;
    for (int c = 0; c < variables[v].dim; ++c, column += rows)
      for (int i = 0; i < rows; ++i)
        r(i) += column[i] * variables[v].delta(c);
  }
  for (int i = 0; i < rows; ++i)
    r(i) -= column[i];
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

/// Of a weighted residual: what the geometry's curvature makes, and a share of what the weight does
/// that no longer fits. A wrong weight only makes the loss a little softer or harder.
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
double Smoother::State::linearisationError(const Factor &factor) const
{
  if (factor.stale)
    return 0;
  if (factor.kind == FactorKind::observation) {
    const Vector4d r = residual(observations[factor.data].root, options.bMc,
                                estimate(poses[variables[factor.a].number]),
                                estimate(trunks[variables[factor.b].number]), nullptr, nullptr);
    return modelError<4>(options.summary_loss, factor.cost, r, linearPrediction(factor).head<4>());
  }
  if (factor.kind == FactorKind::odometry) {
    const OdometryData &data = odometry[factor.data];
    const Vector6d r = residual(data.factor, data.S, estimate(poses[variables[factor.a].number]),
                                estimate(poses[variables[factor.b].number]), nullptr, nullptr);
    return (r - linearPrediction(factor)).norm();
  }
  if (factor.kind == FactorKind::relative_pose) {
    const RelativePoseData &data = relative_poses[factor.data];
    const Vector5d r =
        residual(data.factor, data.S, options.bMc, estimate(poses[variables[factor.a].number]),
                 estimate(poses[variables[factor.b].number]), nullptr, nullptr);
    return modelError<5>(options.direction_loss, factor.cost, r,
                         linearPrediction(factor).head<5>());
  }
  return 0;
}

/// The largest part of \p step, in thresholds of relinearisation.
double Smoother::State::inThresholds(const Variable &variable, const Vector6d &step) const
{
  const double position = step.head(variable.is_pose ? 3 : 2).cwiseAbs().maxCoeff();
  const double rest =
      variable.is_pose
          ? step.tail<3>().cwiseAbs().maxCoeff() / options.relinearise_rotation
          : std::max(std::abs(step(2)) / options.relinearise_log_radius,
                     step.segment<2>(3).cwiseAbs().maxCoeff() / options.relinearise_lean);
  return std::max(position / options.relinearise_position, rest);
}

/// Probes the factors only where the estimate has moved on since they were last found good. Pose
/// priors are linear enough never to ask for more than their pose's own factors do.
bool Smoother::State::movedTooFar(Variable &variable) const
{
  if (inThresholds(variable, variable.delta - variable.probed) <= 1)
    return false;
  // A common shift changes no view, but may not grow without bound: small errors of many add up.
  if (variable.is_pose && inThresholds(variable, variable.delta) > kLargestShift)
    return true;
  const std::size_t count = variable.factors.size();
  const std::size_t every = variable.is_pose ? 1 : std::max<std::size_t>(1, count / kFactorsProbed);
  for (std::size_t i = 0; i < count; i += every)
    if (linearisationError(factors[variable.factors[count - 1 - i]]) >
        options.linearisation_tolerance)
      return true;
  variable.probed = variable.delta;
  return false;
}

/// Are all neighbours by factors to be eliminated again anyway?
bool Smoother::State::isInside(const Variable &variable) const
{
  return std::all_of(variable.factors.begin(), variable.factors.end(), [this](int id) {
    const Factor &factor = factors[id];
    return factor.kind != FactorKind::marginal && variables[factor.a].affected == stamp &&
           (factor.b < 0 || variables[factor.b].affected == stamp);
  });
}

void Smoother::State::relinearise(int v)
{
  Variable &variable = variables[v];
  if (variable.is_pose) {
    PoseState &pose = poses[variable.number];
    pose.point = pose.point.plus(variable.delta);
  }
  else {
    TrunkState &trunk = trunks[variable.number];
    trunk.point = trunk.point.plus(limitedTrunkStep(trunk, variable.delta.head<5>()));
  }
  variable.delta.setZero();
  variable.probed.setZero();
  touch(v);
  for (const int id : variable.factors) {
    Factor &factor = factors[id];
    if (!factor.stale) {
      constant_cost -= factor.cost;
      factor.cost = 0;
      factor.stale = true;
      stale_factors.push_back(id);
    }
    if (factor.kind == FactorKind::marginal) {
      for (const int other : marginals[factor.data].variables)
        touch(other);
    }
    else {
      touch(factor.a);
      if (factor.b >= 0)
        touch(factor.b);
    }
  }
}
} // namespace bole
