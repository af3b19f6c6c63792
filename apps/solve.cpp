// SPDX-License-Identifier: GPL-2.0-or-later
// `bole solve`: the optimum of a saved graph.
#include "commands.h"

#include <bole/graph.h>
#include <bole/smoother.h>

#include <chrono>
#include <fmt/core.h>

namespace bole::apps
{
namespace
{
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
