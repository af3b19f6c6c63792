// SPDX-License-Identifier: GPL-2.0-or-later
// `bole graph` and `bole solve`: what the smoother of a run was given and made of it, and the optimum of a saved graph.
#include "commands.h"

#include <bole/graph.h>
#include <bole/smoother.h>

#include <algorithm>
#include <chrono>
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

void solve(const std::string &file, const std::string &output, double tolerance)
{
  const Graph graph = readG2o(file);
  fmt::print("{}: {} poses, {} trunks, {} summaries; cost {:.9g}\n", file, graph.poses.size(), graph.trunks.size(),
             graph.observations.size(), cost(graph));
  if (!graph.assumed.empty())
    fmt::print("{}\n", graph.assumed);
  Smoother smoother(graph, SmootherOptions());
  const auto start = std::chrono::steady_clock::now();
  const UpdateResult result = smoother.optimize(tolerance);
  const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
  fmt::print("{}: cost {:.9g} after {} iterations, {:.1f} ms\n", toString(result.status), result.cost,
             result.iterations, ms.count());
  if (output.empty())
    return;
  Graph solved = graph; // the ids of the file stay
  for (std::size_t i = 0; i < solved.poses.size(); ++i)
    solved.poses[i].wMb = smoother.pose(i);
  for (std::size_t j = 0; j < solved.trunks.size(); ++j)
    solved.trunks[j].trunk = smoother.trunk(j);
  writeG2o(output, solved);
  fmt::print("{}\n", output);
}
} // namespace

void addGraph(CLI::App &app)
{
  const auto run = std::make_shared<std::string>();
  CLI::App *command = app.add_subcommand("graph", "Statistics of the graph of a run");
  command->add_option("RUN", *run, "folder that `bole track` wrote (holds graph.g2o)")->required();
  command->footer("`bole export RUN g2o` writes it.\nExample:\n  bole graph run");
  command->callback([run] { printStatistics(readG2o(*run + "/graph.g2o")); });
}

void addSolve(CLI::App &app)
{
  struct SolveArguments
  {
    std::string file, output;
    double tolerance = 1e-9;
  };
  const auto arguments = std::make_shared<SolveArguments>();
  CLI::App *command = app.add_subcommand("solve", "The optimum of a graph in g2o text");
  command->add_option("FILE", arguments->file, "graph, tags as in bole/graph.h")->required();
  command->add_option("-o,--output", arguments->output, "write the solved graph here");
  command->add_option("--tolerance", arguments->tolerance, "stop when the cost falls by less, relative")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command->footer("Example:\n  bole solve run/graph.g2o --output solved.g2o");
  command->callback([arguments] { solve(arguments->file, arguments->output, arguments->tolerance); });
}
} // namespace bole::apps
