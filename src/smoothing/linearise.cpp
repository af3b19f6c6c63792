// SPDX-License-Identifier: GPL-2.0-or-later
// From factors to whitened linear blocks, and the cost at the estimates.
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
namespace
{
template <int Rows, int Columns> using Block = Eigen::Map<Eigen::Matrix<double, Rows, Columns>>;

/// Writes [J_a J_b -r] with the square root of the loss' weight; returns rho / 2.
template <int Rows, int A, int B>
double store2(const Loss &loss, const Eigen::Matrix<double, Rows, A> &J_a, const Eigen::Matrix<double, Rows, B> &J_b,
              const Eigen::Matrix<double, Rows, 1> &r, double *linear)
{
  const double s = r.squaredNorm();
  const double root = std::sqrt(loss.weight(s));
  Block<Rows, A>(linear).noalias() = root * J_a;
  Block<Rows, B>(linear + Rows * A).noalias() = root * J_b;
  Block<Rows, 1>(linear + Rows * (A + B)).noalias() = -root * r;
  return 0.5 * loss.rho(s);
}

template <int Rows, int A>
double store1(const Eigen::Matrix<double, Rows, A> &J, const Eigen::Matrix<double, Rows, 1> &r, double *linear)
{
  for (int c = 0; c < A; ++c)
    for (int i = 0; i < Rows; ++i)
      linear[c * Rows + i] = J(i, c);
  Block<Rows, 1>(linear + Rows * A) = -r;
  return 0.5 * r.squaredNorm();
}
} // namespace

Trunk shifted(Trunk trunk, const Eigen::Vector3d &shift)
{
  trunk.xy += shift.head<2>() - shift.z() * trunk.lean;
  return trunk;
}

void Smoother::State::linearise(Factor &factor)
{
  if (!factor.stale)
    constant_cost -= factor.cost;
  if (factor.linear == nullptr && factor.kind != FactorKind::marginal)
    factor.linear = std::make_unique<double[]>(blockSize(factor.kind));
  const auto pose = [this](int v) -> const Pose & { return poses[variables[v].number].point; };
  switch (factor.kind) {
  case FactorKind::pose_prior: {
    Matrix6d J;
    const PosePrior &data = pose_priors[factor.data];
    const Vector6d r = residual(data, squareRootInformation(data), pose(factor.a), &J);
    factor.cost = store1<6, 6>(J, r, factor.linear.get());
    break;
  }
  case FactorKind::odometry: {
    Matrix6d J_a, J_b;
    const Odometry &data = odometry[factor.data];
    const Vector6d r = residual(data, squareRootInformation(data), pose(factor.a), pose(factor.b), &J_a, &J_b);
    factor.cost = store2<6, 6, 6>(Loss(), J_a, J_b, r, factor.linear.get());
    break;
  }
  case FactorKind::relative_pose: {
    Matrix56d J_a, J_b;
    const RelativePoseMeasurement &data = relative_poses[factor.data];
    const Vector5d r =
        residual(data, squareRootInformation(data), options.bMc, pose(factor.a), pose(factor.b), &J_a, &J_b);
    factor.cost = store2<5, 6, 6>(options.direction_loss, J_a, J_b, r, factor.linear.get());
    break;
  }
  case FactorKind::observation: {
    Matrix46d J_pose;
    Matrix45d J_trunk;
    const Vector4d r = residual(observations[factor.data], options.bMc, pose(factor.a),
                                trunks[variables[factor.b].number].point, &J_pose, &J_trunk);
    factor.cost = store2<4, 6, 5>(options.summary_loss, J_pose, J_trunk, r, factor.linear.get());
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
    const PosePrior &data = pose_priors[factor.data];
    return 0.5 * residual(data, squareRootInformation(data), pose(factor.a), nullptr).squaredNorm();
  }
  case FactorKind::odometry: {
    const Odometry &data = odometry[factor.data];
    return 0.5 *
           residual(data, squareRootInformation(data), pose(factor.a), pose(factor.b), nullptr, nullptr).squaredNorm();
  }
  case FactorKind::relative_pose: {
    const RelativePoseMeasurement &data = relative_poses[factor.data];
    const Vector5d r =
        residual(data, squareRootInformation(data), options.bMc, pose(factor.a), pose(factor.b), nullptr, nullptr);
    return 0.5 * options.direction_loss.rho(r.squaredNorm());
  }
  case FactorKind::observation: {
    const Vector4d r = residual(observations[factor.data], options.bMc, pose(factor.a),
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
  return trunk.point.plus(limitedTrunkStep(trunk, variables[trunk.variable].delta.head<5>()));
}

/// A step that would throw a trunk across the camera, or change its radius manyfold, is outside
/// what the linearisation knows: only part of it is taken, and the rest found anew from there.
Vector5d Smoother::State::limitedTrunkStep(const TrunkState &trunk, const Vector5d &delta) const
{
  const Vector5d step = delta - trunk.kept;
  const double move = step.head<2>().norm();
  const double resize = std::abs(step(2));
  if (move < 0.1 && resize < 0.5)
    return delta;
  double distance = 10;
  if (!poses.empty())
    distance = (poses[trunk.last_pose].point.t.head<2>() - trunk.point.xy).norm();
  const double limit = std::max(0.1, 0.5 * distance);
  return trunk.kept + step * std::min({1.0, limit / std::max(move, 1e-9), 0.7 / std::max(resize, 1e-9)});
}

/// Whether all neighbours by factors are eliminated again in this update anyway.
bool Smoother::State::isInside(const Variable &variable) const
{
  return std::all_of(variable.factors.begin(), variable.factors.end(), [this](int id) {
    const Factor &factor = factors[id];
    return factor.kind != FactorKind::marginal && variables[factor.a].affected == stamp &&
           (factor.b < 0 || variables[factor.b].affected == stamp);
  });
}

/// Puts the point of \p v where its estimate is, but for \p shift; the estimate stays.
void Smoother::State::relinearise(int v, const Eigen::Vector3d &shift)
{
  Variable &variable = variables[v];
  if (variable.is_pose) {
    PoseState &pose = poses[variable.number];
    pose.point = estimate(pose);
    variable.delta << pose.point.R.transpose() * -shift, Eigen::Vector3d::Zero();
    pose.point.t += shift;
  }
  else {
    TrunkState &trunk = trunks[variable.number];
    const Trunk now = trunk.point.plus(limitedTrunkStep(trunk, variable.delta.head<5>()));
    trunk.point = shifted(now, shift);
    variable.delta.head<5>() = trunk.kept = now.minus(trunk.point);
  }
  rememberProbe(variable);
  touchNeighbours(v);
  for (const int id : variable.factors) {
    Factor &factor = factors[id];
    if (!factor.stale) {
      constant_cost -= factor.cost;
      factor.cost = 0;
      factor.stale = true;
      stale_factors.push_back(id);
    }
  }
}

void Smoother::State::touchNeighbours(int v)
{
  touch(v);
  for (const int id : variables[v].factors) {
    const Factor &factor = factors[id];
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
