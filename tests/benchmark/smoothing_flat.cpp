// SPDX-License-Identifier: GPL-2.0-or-later
// Time a frame over a long flight: must not grow with its length. Writes <poses> <ms of update>
// <bytes> lines for the figure.
#include "support/flight.h"

#include <cstdio>
#include <ctime>
#include <fmt/core.h>

namespace
{
/// Time this thread computed [ms]: others on the machine do not count.
double threadMs()
{
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double quantile(std::vector<double> values, double q)
{
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}
} // namespace

int main(int argc, char **argv)
{
  bole::test::FlightOptions o;
  o.poses = argc > 1 ? std::atoi(argv[1]) : 20000;
  const bole::test::Flight flight = bole::test::simulateFlight(o);
  bole::test::Replay replay(flight, bole::test::smootherFor(o));
  std::vector<double> ms;
  std::size_t relinearised = 0, eliminated = 0, resolved = 0, limit = 0, views = 0;
  for (int i = 0; i < o.poses; ++i) {
    const double start = threadMs();
    const bole::UpdateResult result = replay.step();
    ms.push_back(threadMs() - start);
    relinearised += result.relinearised;
    eliminated += result.eliminated;
    resolved += result.resolved;
    limit += result.status != bole::UpdateStatus::ok;
    views += flight.views[i].size();
    if ((i + 1) % std::max(1, o.poses / 20) == 0) {
      const std::size_t window = std::min<std::size_t>(500, ms.size());
      const std::vector<double> last(ms.end() - static_cast<long>(window), ms.end());
      fmt::print("{:6d} poses: median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms, {:.1f} MB\n", i + 1,
                 quantile(last, 0.5), quantile(last, 0.99), quantile(last, 1),
                 static_cast<double>(replay.smoother.memoryBytes()) / 1e6);
      std::fflush(stdout);
    }
  }
  const double n = o.poses;
  fmt::print("{} poses, {} trunks, {:.1f} views a pose; a frame: {:.2f} relinearised, {:.1f} "
             "eliminated, {:.1f} solved; "
             "{} frames unsettled\n",
             o.poses, flight.trunks.size(), static_cast<double>(views) / n,
             static_cast<double>(relinearised) / n, static_cast<double>(eliminated) / n,
             static_cast<double>(resolved) / n, limit);
  fmt::print("all frames: median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms\n", quantile(ms, 0.5),
             quantile(ms, 0.99), quantile(ms, 1));
}
