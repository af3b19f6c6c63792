// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/simulated_flight.h"

#include <benchmark/benchmark.h>

namespace
{
/// One frame of 320x240 of a forest of the density state.range(1) / 1000, on one core.
void renderFrame(benchmark::State &state)
{
  bole::FlightOptions flight;
  flight.kind = bole::PathKind::slalom;
  const bole::FlightPath path(flight);
  bole::ForestOptions forest;
  forest.density = 1e-3 * static_cast<double>(state.range(1));
  bole::RendererOptions options;
  options.samples_per_pixel = static_cast<int>(state.range(0));
  bole::ForestRenderer renderer(bole::Forest::plant(forest, path.waypoints(), path.gates()), options);
  bole::RenderedFrame frame;
  double t = 0;
  for (auto _ : state) {
    renderer.render(path.bodyPose(t) * bole::forwardCamera(), path.bodyPose(t + 0.006) * bole::forwardCamera(), frame);
    t = t > 10 ? 0 : t + 0.1;
  }
  state.counters["frames/s"] = benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(renderFrame)
    ->ArgNames({"samples", "trunks_per_1000m2"})
    ->Args({2, 50})
    ->Args({3, 50})
    ->Args({4, 50})
    ->Args({4, 120})
    ->Args({8, 50})
    ->Args({16, 50})
    ->Unit(benchmark::kMillisecond);
} // namespace

BENCHMARK_MAIN();
