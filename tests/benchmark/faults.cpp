// SPDX-License-Identifier: GPL-2.0-or-later
// The table of faults of src/doc/ardrone.md: the emulator flies park-forward with each of them, a consumer takes
// what the live source gives, and every picture called `ok` is looked up among the pictures flown.
// Then reboots at many times, for how soon a good frame is there once the drone is back.
//
//   benchmark_faults [loss]     about six minutes, or the rows that say so; BOLE_FAULT_SECONDS=8
//   flies only the first 8 s
#include "ardrone/drone_link.h"
#include "emulator/emulator.h"
#include <bole/ardrone_source.h>
#include <bole/open_source.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fmt/format.h>
#include <limits>
#include <map>
#include <memory>

namespace
{
using namespace bole;
constexpr double kRate_hz = 10, kGiveUp_s = 4, kDeadline_s = 60, kReboot_s = 1;
constexpr int kStep_px = 4; // pictures are compared on a grid

const std::string kFlight = std::string(BOLE_SHARED_DATA_DIR) + "/rendered/park-forward";

std::int64_t nowNs() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

using Grid = std::vector<std::uint8_t>;

Grid gridOf(const std::uint8_t *pixels, int width, int height)
{
  Grid grid;
  for (int v = 0; v < height; v += kStep_px)
    for (int u = 0; u < width; u += kStep_px)
      grid.push_back(pixels[static_cast<std::size_t>(v) * width + u]);
  return grid;
}

std::vector<Grid> flownPictures()
{
  const auto source = openSource(kFlight);
  std::vector<Grid> pictures;
  for (;;) {
    Frame frame;
    if (!source->next(frame))
      return pictures;
    pictures.push_back(gridOf(frame.image.bitmap, static_cast<int>(frame.image.getWidth()),
                              static_cast<int>(frame.image.getHeight())));
  }
}

/// Index of the picture of \p flown that \p seen is.
int lookUp(const Grid &seen, const std::vector<Grid> &flown)
{
  int best = -1;
  long least = std::numeric_limits<long>::max();
  for (std::size_t i = 0; i < flown.size(); ++i) {
    if (flown[i].size() != seen.size())
      continue;
    long sum = 0;
    for (std::size_t k = 0; k < seen.size() && sum < least; ++k)
      sum += std::abs(static_cast<int>(seen[k]) - flown[i][k]);
    if (sum < least) {
      least = sum;
      best = static_cast<int>(i);
    }
  }
  return best;
}

struct Fault
{
  std::string name;
  ArDroneEmulator::Options options;
  double over_s = -1; ///< flight time at which the fault is over; < 0: it lasts
};

std::vector<Fault> allFaults()
{
  std::vector<Fault> faults(9);
  faults[0].name = "none";
  faults[1].name = "`--loss 0.05`";
  faults[1].options.loss = 0.05;
  faults[2].name = "`--jitter 50`";
  faults[2].options.jitter_s = 0.05;
  faults[3].name = "`--corrupt 0.05`";
  faults[3].options.corrupt = 0.05;
  faults[4].name = "`--reboot 4`";
  faults[4].options.reboot_at_s = 4;
  faults[4].over_s = 4 + kReboot_s;
  faults[5].name = "`--freeze 4`";
  faults[5].options.freeze_at_s = 4;
  faults[5].over_s = 6;
  faults[6].name = "`--stall 4`";
  faults[6].options.stall_at_s = 4; // the first frame after it is a key frame
  faults[6].over_s = 6;
  faults[7].name = "`--clock-wrap`";
  faults[7].options.clock_wrap = true;
  faults[8].name = "`--loss 0.05 --corrupt 0.05 --jitter 30 --reboot 4 --clock-wrap`";
  faults[8].options.loss = faults[8].options.corrupt = 0.05;
  faults[8].options.jitter_s = 0.03;
  faults[8].options.reboot_at_s = 4;
  faults[8].options.clock_wrap = true;
  faults[8].over_s = 4 + kReboot_s;
  return faults;
}

struct Seen
{
  Grid picture;
  std::int64_t arrival_ns = 0;
  double age_s = 0;    ///< since the last byte, when it was handed out
  double flight_s = 0; ///< what the emulator had sent by the time that the frame was handed out
};

struct Outcome
{
  ArDroneEmulator::Counters injected;
  LinkCounters link;
  std::map<FrameStatus, int> count;
  std::vector<Seen> good;
  bool ended = false;
};

std::unique_ptr<ArDroneEmulator> startEmulator(int generation, const ArDroneEmulator::Options &options,
                                               std::size_t frames)
{
  const auto sequence = openSource(kFlight);
  SequenceFeedOptions feed;
  feed.generation = generation;
  feed.max_frames = frames;
  auto emulator = std::make_unique<ArDroneEmulator>(makeSequenceFeed(*sequence, feed), options);
  emulator->start();
  return emulator;
}

Outcome fly(int generation, const Fault &fault, std::size_t frames)
{
  const auto emulator = startEmulator(generation, fault.options, frames);
  ArDroneAddress address = ArDroneAddress::parse(emulator->address());
  address.camera_path = kFlight + "/mav0/cam0/sensor.yaml";
  ArDroneSource::Options options;
  options.give_up_s = kGiveUp_s;
  ArDroneSource source(address.toString(), options);
  Outcome outcome;
  std::map<FrameStatus, int> since_last; // those of the silence after the flight do not count
  const std::int64_t end_ns = nowNs() + static_cast<std::int64_t>(kDeadline_s * 1e9);
  for (Frame frame; nowNs() < end_ns;) {
    if (!source.next(frame)) {
      outcome.ended = true;
      break;
    }
    ++since_last[frame.status];
    if (frame.status == FrameStatus::missing)
      continue;
    for (const auto &[status, count] : since_last)
      outcome.count[status] += count;
    since_last.clear();
    if (frame.status == FrameStatus::ok) {
      const YuvPicture &picture = source.liveFrame().picture;
      outcome.good.push_back({gridOf(picture.y.data(), picture.width, picture.height), frame.arrival_ns,
                              static_cast<double>(nowNs() - frame.arrival_ns) * 1e-9, emulator->counters().flight_s});
    }
  }
  outcome.link = source.counters();
  outcome.injected = emulator->counters();
  return outcome;
}

/// Frames called `ok` whose picture is none that came after the one before it, or was handed out
/// when the drone had been flying on for more than a frame (and the jitter) since it sent it.
int countStale(const Outcome &outcome, const std::vector<Grid> &flown, double jitter_s)
{
  int stale = 0, newest = -1;
  for (const Seen &seen : outcome.good) {
    const int index = lookUp(seen.picture, flown);
    const double behind_s = seen.flight_s - index / kRate_hz - kVideoDelay_s;
    if (index <= newest || behind_s > 1 / kRate_hz + jitter_s) {
      ++stale;
      fmt::print(stderr, "picture {} after {} called ok, {:.3f} s behind; {:.3f} s old\n", index, newest, behind_s,
                 seen.age_s);
    }
    newest = std::max(newest, index);
  }
  return stale;
}

/// [s] from the end of the fault to the first good frame; of a fault that lasts, the longest time
/// between two good frames.
double recovery(const Outcome &outcome, const Fault &fault)
{
  if (fault.over_s >= 0) {
    const std::int64_t over_ns = outcome.injected.started_ns + static_cast<std::int64_t>(fault.over_s * 1e9);
    for (const Seen &seen : outcome.good)
      if (seen.arrival_ns >= over_ns)
        return static_cast<double>(seen.arrival_ns - over_ns) * 1e-9;
    return std::numeric_limits<double>::infinity();
  }
  std::int64_t longest_ns = 0;
  for (std::size_t i = 1; i < outcome.good.size(); ++i)
    longest_ns = std::max(longest_ns, outcome.good[i].arrival_ns - outcome.good[i - 1].arrival_ns);
  return static_cast<double>(longest_ns) * 1e-9;
}

std::string row(int generation, const Fault &fault, Outcome &outcome, const std::vector<Grid> &flown)
{
  const auto &in = outcome.injected;
  const auto of = [&](FrameStatus status) { return outcome.count[status]; };
  return fmt::format("| {} | {} | {}, {} | {}, {}, {} | {}, {}, {}, {} | {} | {}, {} | {} | {} {:.2f} | {} |",
                     fault.name, generation, in.frames, in.navdata, in.lost, in.corrupted_frames, in.corrupted_navdata,
                     of(FrameStatus::ok), of(FrameStatus::corrupt), of(FrameStatus::stale), of(FrameStatus::missing),
                     outcome.link.dropped, outcome.link.navdata_refused, outcome.link.navdata_late,
                     countStale(outcome, flown, fault.options.jitter_s), fault.over_s >= 0 ? "back" : "gap",
                     recovery(outcome, fault), outcome.ended ? "yes" : "no");
}

/// [s] from the drone's return to the first good frame, of \p times reboots. Thirty frames a
/// second, as an AR.Drone 2 sends.
std::vector<double> reconnections(int generation, int times)
{
  constexpr double kSpeed = 30 / kRate_hz;
  std::vector<double> after_s;
  for (int i = 0; i < times; ++i) {
    ArDroneEmulator::Options options;
    options.speed = kSpeed;
    options.reboot_at_s = 3 + 0.137 * i; // whatever the phase of key frames, wake-ups and retries
    options.reboot_for_s = kReboot_s;
    const auto emulator = startEmulator(generation, options, 0);
    DroneLink link(ArDroneAddress::parse(emulator->address()));
    LiveFrame frame;
    const std::int64_t end_ns = nowNs() + 20'000'000'000;
    while (nowNs() < end_ns) {
      const bool good = link.next(frame, 0.05) && frame.status == FrameStatus::ok;
      const auto counters = emulator->counters();
      const std::int64_t back_ns =
          counters.started_ns + static_cast<std::int64_t>((options.reboot_at_s / kSpeed + kReboot_s) * 1e9);
      if (good && counters.reboots == 1 && frame.arrival_ns >= back_ns) {
        after_s.push_back(static_cast<double>(frame.arrival_ns - back_ns) * 1e-9);
        break;
      }
    }
  }
  std::sort(after_s.begin(), after_s.end());
  return after_s;
}
} // namespace

int main(int argc, char **argv)
{
  const std::string only = argc > 1 ? argv[1] : ""; // rows whose fault holds this
  const char *seconds = std::getenv("BOLE_FAULT_SECONDS");
  const std::size_t frames = seconds != nullptr ? static_cast<std::size_t>(kRate_hz * std::atof(seconds)) : 0;
  const std::vector<Grid> flown = flownPictures();
  fmt::print("| fault | AR.Drone | sent: frames, navdata | lost, damaged frames, damaged navdata | "
             "ok, corrupt, stale, "
             "missing | dropped | navdata refused, late | ok though stale | recovered [s] | ended "
             "by itself |\n"
             "|---|---|---|---|---|---|---|---|---|---|\n");
  for (const Fault &fault : allFaults()) {
    if (fault.name.find(only) == std::string::npos)
      continue;
    for (const int generation : {2, 1}) {
      Outcome outcome = fly(generation, fault, frames);
      fmt::print("{}\n", row(generation, fault, outcome, flown));
      std::fflush(stdout);
    }
  }
  constexpr int kReboots = 12;
  for (const int generation : {2, 1}) {
    const auto after_s = reconnections(generation, kReboots);
    fmt::print("AR.Drone {}: {} reboots, {} seen again; after {:.2f} s (median), {:.2f} s (longest)\n", generation,
               kReboots, after_s.size(), after_s.empty() ? 0 : after_s[after_s.size() / 2],
               after_s.empty() ? 0 : after_s.back());
  }
  return 0;
}
