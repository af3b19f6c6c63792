// SPDX-License-Identifier: GPL-2.0-or-later
// Age of the frames of a live drone: an emulator flies there and back at twice real time, a
// consumer works 15 ms on each frame. BOLE_LIVE_SECONDS (default 10) sets the length of the run, of
// the host's clock.
#include "emulator/emulator.h"
#include <bole/ardrone_source.h>
#include <bole/open_source.h>

#include <algorithm>
#include <benchmark/benchmark.h>
#include <chrono>
#include <cstdlib>
#include <thread>

namespace
{
std::int64_t nowNs() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

void LiveFrameAge(benchmark::State &state)
{
  const char *length = std::getenv("BOLE_LIVE_SECONDS");
  const double seconds = length != nullptr ? std::atof(length) : 10;
  const std::string flight = std::string(BOLE_SHARED_DATA_DIR) + "/rendered/park-forward";
  for (auto _ : state) {
    const auto sequence = bole::openSource(flight);
    bole::SequenceFeedOptions feed;
    feed.generation = static_cast<int>(state.range(0));
    feed.loop = true;
    bole::ArDroneEmulator::Options options;
    options.speed = 2;
    bole::ArDroneEmulator emulator(bole::makeSequenceFeed(*sequence, feed), options);
    emulator.start();
    bole::ArDroneSource source(emulator.address() + "&camera=" + flight + "/mav0/cam0/sensor.yaml", {});
    std::vector<double> ages_ms;
    const std::int64_t end_ns = nowNs() + static_cast<std::int64_t>(seconds * 1e9);
    for (bole::Frame frame; nowNs() < end_ns && source.next(frame);) {
      if (frame.status == bole::FrameStatus::ok)
        ages_ms.push_back(static_cast<double>(nowNs() - frame.arrival_ns) * 1e-6);
      std::this_thread::sleep_for(std::chrono::milliseconds(15));
    }
    if (ages_ms.size() < 20)
      return state.SkipWithError("too few frames");
    const std::vector<double> last(ages_ms.end() - static_cast<std::ptrdiff_t>(ages_ms.size() / 10), ages_ms.end());
    const auto quantile = [](std::vector<double> values, double q) {
      std::sort(values.begin(), values.end());
      return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
    };
    state.counters["frames"] = static_cast<double>(ages_ms.size());
    state.counters["dropped"] = static_cast<double>(source.counters().dropped);
    state.counters["age_median_ms"] = quantile(ages_ms, 0.5);
    state.counters["age_99_ms"] = quantile(ages_ms, 0.99);
    state.counters["age_median_last_tenth_ms"] = quantile(last, 0.5);
  }
}
BENCHMARK(LiveFrameAge)->Arg(2)->Arg(1)->Iterations(1)->Unit(benchmark::kSecond);
} // namespace

BENCHMARK_MAIN();
