// SPDX-License-Identifier: GPL-2.0-or-later
// The fixed lag: variables too far behind are marginalised into a linear prior on their neighbours.
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
/// Marginalises a variable that is a leaf of the elimination tree: its contribution becomes a linear prior on its
/// neighbours.
void Smoother::State::marginaliseVariable(int id)
{
  Variable &v = variables[id];
  if (v.is_pose) {
    if (v.number % kCovarianceEvery == 0)
      marginalised_covariances.push_back(poseCovariance(v.number));
    poses[v.number].point = estimate(poses[v.number]);
    poses[v.number].variable = -1;
  }
  else {
    trunks[v.number].marginalised_covariance = trunkCovariance(v.number);
    trunks[v.number].marginalised_place_covariance = placeCovariance(v.number);
    trunks[v.number].point = estimate(trunks[v.number]);
    trunks[v.number].variable = -1;
  }
  for (const int f : v.assembled) {
    Factor &factor = factors[f];
    if (!factor.alive)
      continue;
    factor.alive = false;
    dropped_factors.push_back(f);
    if (factor.kind == FactorKind::observation)
      --live_observations;
    const std::vector<int> pair = {factor.a, factor.b};
    for (const int other : factor.kind == FactorKind::marginal ? marginals[factor.data].variables : pair)
      if (other >= 0 && other != id) {
        std::vector<int> &list = variables[other].factors;
        list.erase(std::remove(list.begin(), list.end(), f), list.end());
      }
    if (factor.kind == FactorKind::marginal) { // its numbers are in the new one
      marginals[factor.data].H.resize(0, 0);
      marginals[factor.data].poses.clear();
      marginals[factor.data].trunks.clear();
    }
  }
  if (!v.separator.empty()) {
    const int m = v.separator_dim;
    MarginalData data;
    data.variables = v.separator;
    data.H.resize(m, m);
    data.g.resize(m);
    const double *from = v.contribution.data();
    for (int c = 0; c < m; ++c)
      for (int r = c; r < m; ++r)
        data.H(r, c) = data.H(c, r) = *from++;
    for (int c = 0; c < m; ++c)
      data.g(c) = *from++;
    data.g_there = data.g;
    Factor factor;
    factor.kind = FactorKind::marginal;
    factor.stale = false;
    factor.a = v.separator.front();
    factor.assembled_at = v.parent;
    const int id_factor = placeFactor(std::move(factor));
    for (const int other : v.separator) {
      const Variable &neighbour = variables[other];
      data.poses.push_back(neighbour.is_pose ? poses[neighbour.number].point : Pose());
      data.trunks.push_back(neighbour.is_pose ? Trunk() : trunks[neighbour.number].point);
      variables[other].factors.push_back(id_factor);
    }
    factors[id_factor].data = placeData(marginals, FactorKind::marginal, std::move(data));
    Variable &parent = variables[v.parent];
    parent.assembled.push_back(id_factor);
    parent.children.erase(std::remove(parent.children.begin(), parent.children.end(), id), parent.children.end());
  }
  v.life = Life::closed;
  recycle(id);
}

/// Moves the kept trunks behind a pose in the middle of the lag when they have become the oldest open variables, all at
/// once, so that the poses before it are marginalised without eliminating these trunks again.
void Smoother::State::reorderKept()
{
  const auto isBefore = [this](const TrunkState &trunk, int pose) {
    return trunk.is_kept && std::max(trunk.last_pose, trunk.behind) < pose;
  };
  const auto trunkOf = [this](int id) -> TrunkState & { return trunks[variables[id].number]; };
  if (std::none_of(open_trunks.begin(), open_trunks.end(),
                   [&](int id) { return isBefore(trunkOf(id), oldest_open_pose); }))
    return;
  const int middle = static_cast<int>(poses.size()) - 1 - options.fixed_lag / 2;
  for (const int id : open_trunks)
    if (isBefore(trunkOf(id), middle)) {
      trunkOf(id).behind = middle;
      touch(id);
    }
}

void Smoother::State::marginaliseBehindLag()
{
  const int keep_from = static_cast<int>(poses.size()) - options.fixed_lag;
  const auto isLeaf = [this](int id) {
    return variables[id].eliminated && variables[id].children.empty() &&
           (variables[id].has_contribution || variables[id].separator.empty());
  };
  while (true) {
    bool closed = false;
    for (std::size_t i = 0; i < open_trunks.size();) {
      const int id = open_trunks[i];
      const TrunkState &trunk = trunks[variables[id].number];
      if (trunk.is_kept || trunk.last_pose >= oldest_open_pose || !isLeaf(id)) {
        ++i;
        continue;
      }
      marginaliseVariable(id);
      closed = true;
    }
    if (oldest_open_pose < keep_from && isLeaf(poses[oldest_open_pose].variable)) {
      marginaliseVariable(poses[oldest_open_pose].variable);
      ++oldest_open_pose;
      closed = true;
    }
    if (!closed)
      break;
  }
  reorderKept();
}
} // namespace bole
