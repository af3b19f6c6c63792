// SPDX-License-Identifier: GPL-2.0-or-later
// The graph as plain data, out and in.
#include "smoothing/state.h"

namespace bole
{
Graph Smoother::State::graph() const
{
  Graph graph;
  graph.bMc = options.bMc;
  graph.summary_loss = options.summary_loss;
  graph.direction_loss = options.direction_loss;
  std::vector<std::size_t> place(variables.size(), 0);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!isOpen(poses[i].variable))
      continue;
    place[poses[i].variable] = graph.poses.size();
    graph.poses.push_back({static_cast<std::int64_t>(i), estimate(poses[i])});
  }
  for (std::size_t j = 0; j < trunks.size(); ++j) {
    if (trunks[j].removed || !isOpen(trunks[j].variable))
      continue;
    place[trunks[j].variable] = graph.trunks.size();
    graph.trunks.push_back({static_cast<std::int64_t>(poses.size() + j), estimate(trunks[j]), trunks[j].prior});
  }
  if (oldest_open_pose > 0) // what the closed poses leave behind, reduced to the pose after them
    graph.pose_priors.push_back({0, {graph.poses.front().wMb, marginalised_covariances.back()}});
  for (const Factor &factor : factors) {
    if (!factor.alive)
      continue;
    const std::size_t a = place[factor.a], b = factor.b < 0 ? 0 : place[factor.b];
    switch (factor.kind) {
    case FactorKind::pose_prior:
      graph.pose_priors.push_back({a, pose_priors[factor.data]});
      break;
    case FactorKind::odometry:
      graph.odometry.push_back({a, b, odometry[factor.data]});
      break;
    case FactorKind::relative_pose:
      graph.relative_poses.push_back({a, b, relative_poses[factor.data]});
      break;
    case FactorKind::observation:
      graph.observations.push_back({a, b, observations[factor.data].factor()});
      break;
    case FactorKind::marginal:
      break;
    }
  }
  return graph;
}

std::size_t Smoother::State::memoryBytes() const
{
  std::size_t bytes = variables.size() * sizeof(Variable) + factors.size() * sizeof(Factor) +
                      poses.size() * sizeof(PoseState) + trunks.size() * sizeof(TrunkState) +
                      marginalised_covariances.size() * sizeof(Matrix6d) +
                      observations.size() * sizeof(SquareRootSummary) + odometry.size() * sizeof(Odometry) +
                      relative_poses.size() * sizeof(RelativePoseMeasurement) + pose_priors.size() * sizeof(PosePrior);
  for (const Variable &v : variables)
    bytes +=
        (v.columns.capacity() + v.contribution.capacity()) * sizeof(double) + v.old_columns.capacity() * sizeof(float) +
        (v.factors.capacity() + v.children.capacity() + v.separator.capacity() + v.assembled.capacity()) * sizeof(int);
  for (const Factor &factor : factors)
    bytes += factor.linear ? blockSize(factor.kind) * sizeof(double) : 0;
  for (const MarginalData &data : marginals)
    bytes += sizeof(MarginalData) + static_cast<std::size_t>(data.H.size() + 2 * data.g.size()) * sizeof(double);
  return bytes;
}
} // namespace bole
