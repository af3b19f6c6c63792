// SPDX-License-Identifier: GPL-2.0-or-later
// `bole graph`: what the smoother of a run was given and what it made of it.
#include "commands.h"

#include <bole/graph.h>

#include <algorithm>
#include <fmt/core.h>

namespace bole::apps
{
namespace
{
void printStatistics(const Graph &graph)
{
  std::vector<std::size_t> views(graph.trunks.size(), 0);
  for (const Graph::ObservationEdge &edge : graph.observations)
    ++views[edge.trunk];
  std::sort(views.begin(), views.end());
  double length = 0;
  for (std::size_t i = 1; i < graph.poses.size(); ++i)
    length += (graph.poses[i].wMb.t - graph.poses[i - 1].wMb.t).norm();
  fmt::print("poses      {} over {:.2f} m\n", graph.poses.size(), length);
  fmt::print("trunks     {}\n", graph.trunks.size());
  fmt::print("summaries  {}", graph.observations.size());
  if (!views.empty())
    fmt::print(", {} to {} a trunk, median {}", views.front(), views.back(), views[views.size() / 2]);
  fmt::print("\nodometry   {}\ndirections {}\npriors     {}\n", graph.odometry.size(), graph.relative_poses.size(),
             graph.pose_priors.size());
  fmt::print("cost       {:.9g}\n", cost(graph));
}
} // namespace

void addGraph(CLI::App &app)
{
  struct GraphArguments
  {
    std::string run;
  };
  const auto arguments = std::make_shared<GraphArguments>();
  CLI::App *command = app.add_subcommand("graph", "Statistics of the graph of a run");
  command->add_option("RUN", arguments->run, "folder that `bole track` wrote (holds graph.g2o)")->required();
  command->footer("`bole export RUN g2o` writes it.\nExample:\n  bole graph run");
  command->callback([arguments] { printStatistics(readG2o(arguments->run + "/graph.g2o")); });
}
} // namespace bole::apps
