// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as a graph: refused with a line, or read, written and read again, and solved.
#include <bole/graph.h>
#include <bole/smoother.h>

#include <cstdlib>
#include <cstring>
#include <sstream>
#include <visp3/core/vpException.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  std::istringstream in(std::string(data, data + size));
  bole::Graph graph;
  try {
    graph = bole::readG2o(in, "graph");
  }
  catch (const vpException &error) {
    if (std::strncmp(error.what(), "graph:", 6) != 0)
      std::abort(); // the message names the file
    if (std::strtol(error.what() + 6, nullptr, 10) < 1)
      std::abort(); // and the line
    return 0;
  }
  std::stringstream text;
  bole::writeG2o(text, graph);
  const bole::Graph back = bole::readG2o(text, "written");
  if (back.poses.size() != graph.poses.size() || back.trunks.size() != graph.trunks.size() ||
      back.odometry.size() != graph.odometry.size() || back.observations.size() != graph.observations.size())
    std::abort();
  if (graph.poses.empty() || graph.poses.size() + graph.trunks.size() > 30)
    return 0;
  bole::Smoother smoother(graph, bole::SmootherOptions());
  smoother.update();
  smoother.optimize(1e-6, 5);
  return 0;
}
