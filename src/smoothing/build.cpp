// SPDX-License-Identifier: GPL-2.0-or-later
// Growing the graph: variables, factors, and taking them out again.
#include "smoothing/state.h"

#include <algorithm>
#include <visp3/core/vpException.h>

namespace bole
{
void Smoother::State::checkPose(std::size_t pose) const
{
  if (pose >= poses.size())
    throw vpException(vpException::badValue, "pose = %zu, must be below %zu", pose, poses.size());
}

void Smoother::State::checkTrunk(std::size_t trunk) const
{
  if (trunk >= trunks.size() || trunks[trunk].removed)
    throw vpException(vpException::badValue, "trunk = %zu, must be one of the %zu and not removed", trunk,
                      trunks.size());
}

/// The offset from the estimate of a pose to its linearisation point; new points are shifted as those of their
/// neighbours.
Eigen::Vector3d Smoother::State::shiftOfPoint(int pose) const
{
  if (pose < 0 || !isOpen(poses[pose].variable))
    return Eigen::Vector3d::Zero();
  return poses[pose].point.t - estimate(poses[pose]).t;
}

std::size_t Smoother::State::newPose(const Pose &point)
{
  if (!point.isFinite())
    throw vpException(vpException::badValue, "pose, must be finite");
  Variable variable;
  variable.number = static_cast<int>(poses.size());
  PoseState pose;
  pose.point = point;
  pose.point.t += shiftOfPoint(static_cast<int>(poses.size()) - 1);
  variable.delta = point.minus(pose.point);
  pose.variable = placeVariable(std::move(variable));
  poses.push_back(pose);
  rememberProbe(variables[pose.variable]);
  touch(pose.variable);
  return poses.size() - 1;
}

std::size_t Smoother::State::newTrunk(const Trunk &point, const TrunkPrior &prior)
{
  if (!point.minus(Trunk()).allFinite() || !prior.mean.minus(Trunk()).allFinite() || !prior.sigma.allFinite() ||
      !(prior.sigma.array() > 0).all())
    throw vpException(vpException::badValue, "trunk, must be finite with sigmas above 0");
  TrunkState trunk;
  trunk.point = shifted(point, shiftOfPoint(static_cast<int>(poses.size()) - 1));
  trunk.prior = prior;
  trunk.last_pose = std::max<int>(0, static_cast<int>(poses.size()) - 1);
  std::size_t number = trunks.size();
  if (free_trunks.empty())
    trunks.push_back(trunk);
  else {
    number = static_cast<std::size_t>(free_trunks.back());
    free_trunks.pop_back();
    trunks[number] = trunk;
  }
  reopenTrunk(static_cast<int>(number));
  TrunkState &made = trunks[number];
  Variable &variable = variables[made.variable];
  variable.delta.head<5>() = made.kept = point.minus(made.point);
  if (!poses.empty())
    rememberProbe(variable);
  return number;
}

/// Stores a variable where one was recycled, or at the end.
int Smoother::State::placeVariable(Variable variable)
{
  if (free_variables.empty()) {
    variables.push_back(std::move(variable));
    return static_cast<int>(variables.size()) - 1;
  }
  const int id = free_variables.back();
  free_variables.pop_back();
  variables[id] = std::move(variable);
  return id;
}

/// Frees a closed or removed variable that nothing names any more.
void Smoother::State::recycle(int id)
{
  Variable &variable = variables[id];
  if (variable.in_moved)
    moved.erase(std::remove(moved.begin(), moved.end(), id), moved.end());
  if (!variable.is_pose) {
    open_trunks.erase(std::remove(open_trunks.begin(), open_trunks.end(), id), open_trunks.end());
    TrunkState &trunk = trunks[variable.number];
    trunk.variable = -1;
    if (trunk.removed && options.fixed_lag > 0)
      free_trunks.push_back(variable.number);
  }
  const Life life = variable.life;
  variable = Variable();
  variable.life = life;
  free_variables.push_back(id);
}

/// Gives a trunk a variable of its own, at its present point.
void Smoother::State::reopenTrunk(int trunk)
{
  Variable variable;
  variable.is_pose = false;
  variable.number = trunk;
  variable.dim = 5;
  trunks[trunk].variable = placeVariable(std::move(variable));
  trunks[trunk].kept.setZero();
  if (options.fixed_lag > 0)
    open_trunks.push_back(trunks[trunk].variable);
  touch(trunks[trunk].variable);
}

int rowCount(FactorKind kind)
{
  switch (kind) {
  case FactorKind::observation:
    return 4;
  case FactorKind::relative_pose:
    return 5;
  default:
    return 6;
  }
}

int Smoother::State::placeFactor(Factor factor)
{
  if (free_factors.empty()) {
    factors.push_back(std::move(factor));
    return static_cast<int>(factors.size()) - 1;
  }
  const int id = free_factors.back();
  free_factors.pop_back();
  factors[id] = std::move(factor);
  return id;
}

/// The size by the kind of factor alone, as its variables may be marginalised by now.
std::size_t blockSize(FactorKind kind)
{
  const int columns = kind == FactorKind::pose_prior                                      ? 6
                      : kind == FactorKind::odometry || kind == FactorKind::relative_pose ? 12
                                                                                          : 11;
  return static_cast<std::size_t>(rowCount(kind)) * (columns + 1);
}

int Smoother::State::newFactor(FactorKind kind, int data, int a, int b)
{
  Factor factor;
  factor.kind = kind;
  factor.data = data;
  factor.a = a;
  factor.b = b;
  const int id = placeFactor(std::move(factor));
  variables[a].factors.push_back(id);
  touch(a);
  if (b >= 0) {
    variables[b].factors.push_back(id);
    touch(b);
  }
  stale_factors.push_back(id);
  return id;
}

void Smoother::State::dropFactor(int factor)
{
  Factor &gone = factors[factor];
  if (!gone.alive)
    return;
  gone.alive = false;
  dropped_factors.push_back(factor);
  constant_cost -= gone.stale ? 0 : gone.cost;
  if (gone.kind == FactorKind::observation) {
    --live_observations;
    --trunks[variables[gone.b].number].observations;
  }
  for (const int v : {gone.a, gone.b}) {
    if (v < 0)
      continue;
    std::vector<int> &list = variables[v].factors;
    list.erase(std::remove(list.begin(), list.end(), factor), list.end());
    if (isOpen(v))
      touch(v);
  }
}

/// Frees the dropped factors once no eliminated variable names them any more.
void Smoother::State::freeDropped()
{
  for (const int id : dropped_factors) {
    Factor &factor = factors[id];
    free_data[static_cast<std::size_t>(factor.kind)].push_back(factor.data);
    factor.linear.reset();
    free_factors.push_back(id);
  }
  dropped_factors.clear();
  for (const int id : removed_variables)
    recycle(id);
  removed_variables.clear();
}

void Smoother::State::addOdometryFactor(int a, int b, const Odometry &measured)
{
  if (!measured.aMb.isFinite())
    throw vpException(vpException::badValue, "odometry, must be finite");
  squareRootInformation(measured);
  const int variable_a = poses[a].variable, variable_b = poses[b].variable;
  if (!isOpen(variable_a) || !isOpen(variable_b))
    return;
  newFactor(FactorKind::odometry, placeData(odometry, FactorKind::odometry, measured), variable_a, variable_b);
}

/// Opens the trunk, if need be, for what \p pose saw of it.
void Smoother::State::openTrunkFor(int pose, int trunk)
{
  TrunkState &seen = trunks[trunk];
  if (!isOpen(seen.variable)) { // closed by the lag: what was known of it is its prior now
    seen.prior.mean = seen.point;
    seen.prior.sigma = seen.marginalised_covariance.diagonal().cwiseSqrt();
    reopenTrunk(trunk);
  }
  seen.last_pose = std::max(seen.last_pose, pose);
}

void Smoother::State::addObservationFactor(int pose, int trunk, const SquareRootSummary &summary)
{
  openTrunkFor(pose, trunk);
  ++trunks[trunk].observations;
  ++live_observations;
  newFactor(FactorKind::observation, placeData(observations, FactorKind::observation, summary), poses[pose].variable,
            trunks[trunk].variable);
}

void Smoother::State::removeTrunk(int trunk)
{
  TrunkState &gone = trunks[trunk];
  gone.removed = true;
  gone.is_kept = false;
  if (!isOpen(gone.variable)) {
    if (options.fixed_lag > 0)
      free_trunks.push_back(trunk);
    return;
  }
  Variable &variable = variables[gone.variable];
  const std::vector<int> list = variable.factors;
  bool in_marginal = false;
  for (const int factor : list) {
    if (factors[factor].kind == FactorKind::marginal)
      in_marginal = true;
    else
      dropFactor(factor);
  }
  touch(gone.variable);
  if (in_marginal) // it stays as a nuisance until the lag closes it
    return;
  constant_cost -= variable.share;
  variable.share = 0;
  variable.life = Life::removed;
  removed_variables.push_back(gone.variable);
}

void Smoother::State::mergeTrunks(int keep, int gone)
{
  std::vector<std::pair<int, int>> moving; // pose, data
  if (isOpen(trunks[gone].variable))
    for (const int factor : variables[trunks[gone].variable].factors)
      if (factors[factor].kind == FactorKind::observation)
        moving.emplace_back(variables[factors[factor].a].number, factors[factor].data);
  removeTrunk(gone);
  for (const auto &[pose, data] : moving) {
    const SquareRootSummary seen = observations[data];
    addObservationFactor(pose, keep, seen);
  }
}
} // namespace bole
