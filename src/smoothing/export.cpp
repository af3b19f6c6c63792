// SPDX-License-Identifier: GPL-2.0-or-later
// The graph as plain data.
#include "smoothing/state.h"

namespace bole
{
Graph Smoother::State::graph() const
{
  Graph graph;
  graph.bMc = options.bMc;
  graph.summary_loss = options.summary_loss;
  graph.direction_loss = options.direction_loss;
  for (std::size_t i = first_held; i < poses.size(); ++i)
    graph.poses.push_back({static_cast<std::int64_t>(i), poses[i]});
  std::vector<std::size_t> place(trunks.size(), 0);
  for (std::size_t j = 0; j < trunks.size(); ++j) {
    if (trunks[j].is_removed || (options.forgets && !trunks[j].point && trunks[j].seen.empty()))
      continue;
    place[j] = graph.trunks.size();
    graph.trunks.push_back({static_cast<std::int64_t>(poses.size() + j), trunks[j].value, trunks[j].prior});
  }
  if (first_held > 0) // what was forgotten, reduced to the first pose that was not
    graph.pose_priors.push_back({0, {poses[first_held], poseCovariance(first_held)}});
  for (std::size_t i = first_held; i < poses.size(); ++i) {
    const FactorsOfPose &all = factorsOf(i);
    for (const AbsoluteFactor &factor : all.absolutes)
      graph.pose_priors.push_back({i - first_held, factor.measured});
    for (const StepFactor &factor : all.steps)
      graph.odometry.push_back({factor.a - first_held, factor.b - first_held, factor.measured});
    for (const DirectionFactor &factor : all.directions)
      graph.relative_poses.push_back({factor.a - first_held, factor.b - first_held, factor.measured});
    for (const ViewFactor &factor : all.views)
      graph.observations.push_back({i - first_held, place[factor.trunk], factor.seen.factor()});
  }
  return graph;
}
} // namespace bole
