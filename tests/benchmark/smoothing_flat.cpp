// SPDX-License-Identifier: GPL-2.0-or-later
// Time and memory a frame over a long flight: must not grow with its length; and how far what is in sight is from the
// batch optimum along the way. benchmark_smoothing_flat [poses] [curves.csv] [poses a round] [forget]: straight ahead,
// or round after round past the same trunks; "forget": what leaves the window is.
#include "support/curves.h"
#include "support/flight.h"

#include <Eigen/Cholesky>

#include <cstdio>
#include <ctime>
#include <fmt/core.h>
#include <malloc.h>

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

double heapMegabytes()
{
  const auto heap = mallinfo2();
  return static_cast<double>(heap.uordblks + heap.hblkhd) / 1e6;
}

/// The whole graph solved from the present estimate, and how far the views of the last poses were from it.
double compareWithBatch(const bole::test::Replay &replay, const bole::test::Flight &flight)
{
  bole::Smoother again(replay.smoother.graph(), replay.smoother.options());
  const double start = threadMs();
  again.optimize(1e-6);
  const double ms = threadMs() - start;
  again.optimize(1e-10);
  const auto relative = [&](const bole::Smoother &smoother, std::size_t pose, int trunk) {
    return bole::relativeTrunk(smoother.pose(pose), smoother.options().bMc, smoother.trunk(trunk));
  };
  double worst = 0, squares = 0, count = 0; // of the views, in their standard deviations
  for (std::size_t i = static_cast<std::size_t>(std::max(0, replay.next - 40));
       i < static_cast<std::size_t>(replay.next); ++i)
    for (const auto &[j, summary] : flight.views[i]) {
      const int trunk = replay.trunk_id[j];
      const bole::Vector4d apart = relative(replay.smoother, i, trunk).minus(relative(again, i, trunk));
      const double sigmas = std::sqrt(apart.dot(summary.F * apart));
      worst = std::max(worst, sigmas);
      squares += sigmas * sigmas;
      ++count;
    }
  const std::size_t last = replay.smoother.poseCount() - 1;
  const bole::Vector6d off = replay.smoother.pose(last).minus(again.pose(last));
  fmt::print(
      "{:6d} poses: full re-solve {:.1f} ms, cost {:.9g}; views of the last 40 off by {:.3f} (rms), {:.2f} (worst) "
      "standard deviations, the newest pose by {:.3f}\n",
      replay.next, ms, again.cost(), std::sqrt(squares / count), worst,
      std::sqrt(off.dot(again.currentPoseCovariance().llt().solve(off)) / 6));
  return ms;
}
} // namespace

int main(int argc, char **argv)
{
  bole::test::FlightOptions o{argc > 1 ? std::atoi(argv[1]) : 20000};
  o.lap = argc > 3 ? std::atoi(argv[3]) : 0;
  const bole::test::Flight flight = bole::test::simulateFlight(o);
  bole::SmootherOptions options = bole::test::smootherFor(o);
  options.forgets = argc > 4;
  bole::test::Replay replay(flight, options);
  const double before = heapMegabytes();
  std::vector<double> ms;
  bole::test::Curve naive, flat, tail;
  std::size_t limit = 0, views = 0;
  for (int i = 0; i < o.poses; ++i) {
    const double start = threadMs();
    const bole::UpdateResult result = replay.step();
    ms.push_back(threadMs() - start);
    limit += result.status != bole::UpdateStatus::ok;
    views += flight.views[i].size();
    const int n = i + 1;
    if (options.forgets) // there is no whole to compare with
      ;
    else if (n == 125 || n == 250 || n == 500 || n == 1000 || n == 2000 || n == 4000 || n == 8000 || n == 16000 ||
             n == o.poses)
      naive.emplace_back(n, compareWithBatch(replay, flight));
    if ((i + 1) % std::max(1, o.poses / 20) == 0) {
      const std::size_t window = std::min<std::size_t>(500, ms.size());
      const std::vector<double> last(ms.end() - static_cast<long>(window), ms.end());
      flat.emplace_back(i + 1, quantile(last, 0.5));
      tail.emplace_back(i + 1, quantile(last, 0.99));
      fmt::print("{:6d} poses: median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms, {:.1f} MB\n", i + 1, quantile(last, 0.5),
                 quantile(last, 0.99), quantile(last, 1), heapMegabytes() - before);
      std::fflush(stdout);
    }
  }
  const double n = o.poses;
  fmt::print("{} poses, {} trunks, {:.1f} views a pose; {} frames unsettled\n", o.poses, flight.trunks.size(),
             static_cast<double>(views) / n, limit);
  fmt::print("all frames: median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms\n", quantile(ms, 0.5), quantile(ms, 0.99),
             quantile(ms, 1));
  const auto windowMedian = [&](int from, int to) { return quantile({ms.begin() + from, ms.begin() + to}, 0.5); };
  if (o.poses >= 2000)
    fmt::print("median about pose 500: {:.3f} ms; of the last 500: {:.3f} ms, ratio {:.2f}; p99 / "
               "median {:.1f}\n",
               windowMedian(400, 600), windowMedian(o.poses - 500, o.poses),
               windowMedian(o.poses - 500, o.poses) / windowMedian(400, 600), quantile(ms, 0.99) / quantile(ms, 0.5));
  if (argc > 2 && *argv[2] != '\0')
    bole::test::writeCurves(argv[2], "Adding one frame: update of the window and full re-solve", "poses in the graph",
                            "ms of one thread",
                            {{"full re-solve", naive}, {"p99 of 500 updates", tail}, {"median update", flat}});
}
