// SPDX-License-Identifier: GPL-2.0-or-later
// Does a trunk that was hidden for 3 s come back under its old id? Each confirmed trunk that is in view for longer than
// that is painted over, row by row from its left side to its right, as if a bush had come before it, from three frames
// after its confirmation on. Usage: benchmark_reidentification SEQUENCE... (the rendered flights where none is given).
#include "support/rendered_flights.h"

#include "input/asl_source.h"
#include <bole/open_source.h>
#include <bole/pipeline.h>
#include <bole/trunk.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace
{
using namespace bole;

constexpr double kHidden_s = 3, kMatch = 0.5 /* m */, kMarginPx = 6;
constexpr std::size_t kAfterConfirmation = 3, kViewsAfter = 10, kViewsBack = 3;

struct Seen ///< a trunk of the map in a frame
{
  bool is_tracked = false, is_confirmed = false;
};
struct Flight
{
  std::vector<std::map<int, Seen>> frames;
  std::vector<double> time_s;
  std::vector<TrunkRecord> map;
};

/// What hides the trunk \p truth between two frames.
struct Curtain
{
  TruthTrunk truth;
  std::size_t first = 0, end = 0;
};

/// Columns of the borders of \p truth at the height of the camera; nothing where it is not in the image.
std::optional<std::pair<double, double>> columns(const TruthTrunk &truth, const Pose &wMb, const Pose &bMc,
                                                 const PinholeCamera &camera)
{
  Trunk trunk;
  trunk.xy = truth.xy;
  trunk.log_radius = std::log(truth.radius);
  const RelativeTrunk relative = relativeTrunk(wMb, bMc, trunk);
  if (!relative.isFinite() || relative.cRt(2, 0) <= 0.1)
    return std::nullopt;
  std::array<double, 2> u{};
  for (const Border border : {Border::left, Border::right}) {
    const Eigen::Vector3d direction = relative.borderDirection(border, 0);
    if (direction.z() <= 0.05)
      return std::nullopt;
    u[border == Border::left ? 0 : 1] = camera.cx + camera.fx * direction.x() / direction.z();
  }
  if (u[1] < 0 || u[0] > camera.width - 1)
    return std::nullopt;
  return std::pair(u[0], u[1]);
}

void paintOver(vpImage<unsigned char> &image, double left, double right)
{
  const double margin = kMarginPx + 0.1 * (right - left);
  const int width = static_cast<int>(image.getWidth());
  const int from = std::clamp(static_cast<int>(left - margin), 0, width - 1);
  const int to = std::clamp(static_cast<int>(right + margin), 0, width - 1);
  for (unsigned v = 0; v < image.getHeight(); ++v) {
    const double a = from > 0 ? image[v][from] : image[v][to], b = to < width - 1 ? image[v][to] : image[v][from];
    for (int u = from; u <= to; ++u)
      image[v][u] = static_cast<unsigned char>(a + (b - a) * (u - from) / std::max(1, to - from));
  }
}

Flight fly(const std::string &sequence, const std::optional<Curtain> &curtain)
{
  AslSource source(sequence);
  Pipeline pipeline(source.camera(), source.bMc());
  Flight flight;
  for (;;) {
    Frame frame;
    if (!source.next(frame))
      break;
    if (curtain && frame.index >= curtain->first && frame.index < curtain->end && frame.wMb_truth)
      if (const auto u = columns(curtain->truth, *frame.wMb_truth, source.bMc(), source.camera()))
        paintOver(frame.image, u->first, u->second);
    const FrameReport report = pipeline.process(frame);
    std::map<int, Seen> seen;
    for (const TrunkInView &trunk : report.trunks)
      seen[trunk.id] = {trunk.is_tracked, trunk.status == TrunkStatus::confirmed};
    flight.frames.push_back(std::move(seen));
    flight.time_s.push_back(1e-9 * static_cast<double>(frame.stamp_ns));
  }
  pipeline.finish();
  flight.map = pipeline.map();
  return flight;
}

bool isTracked(const Flight &flight, std::size_t frame, int id)
{
  const auto entry = flight.frames[frame].find(id);
  return entry != flight.frames[frame].end() && entry->second.is_tracked;
}

std::size_t viewsFrom(const Flight &flight, std::size_t first, int id)
{
  std::size_t views = 0;
  for (std::size_t i = first; i < flight.frames.size(); ++i)
    views += isTracked(flight, i, id);
  return views;
}

const TruthTrunk *truthOf(const TrunkRecord &trunk, const std::vector<TruthTrunk> &truth)
{
  const TruthTrunk *best = nullptr;
  for (const TruthTrunk &candidate : truth)
    if (candidate.radius > 0 && (candidate.xy - trunk.xy).norm() < kMatch &&
        (best == nullptr || (candidate.xy - trunk.xy).norm() < (best->xy - trunk.xy).norm()))
      best = &candidate;
  return best;
}

/// From when to when the trunk \p id can be hidden and still be seen long enough afterwards.
std::optional<Curtain> curtainFor(const Flight &flight, int id, const TruthTrunk &truth)
{
  for (std::size_t i = 0; i < flight.frames.size(); ++i) {
    const auto entry = flight.frames[i].find(id);
    if (entry == flight.frames[i].end() || !entry->second.is_confirmed)
      continue;
    Curtain curtain{truth, i + kAfterConfirmation, i + kAfterConfirmation};
    while (curtain.end < flight.frames.size() &&
           flight.time_s[curtain.end] < flight.time_s[i] + kHidden_s + 0.1 * static_cast<double>(kAfterConfirmation))
      ++curtain.end;
    return viewsFrom(flight, curtain.end, id) >= kViewsAfter ? std::optional(curtain) : std::nullopt;
  }
  return std::nullopt;
}

struct Counts
{
  int trials = 0, same_id = 0, other_id = 0;
};

Counts measure(const std::string &sequence)
{
  const std::vector<TruthTrunk> truth = readTruthTrunks(sequence);
  const Flight undisturbed = fly(sequence, {});
  Counts counts;
  for (const TrunkRecord &trunk : undisturbed.map) {
    const TruthTrunk *real = trunk.status == TrunkStatus::confirmed ? truthOf(trunk, truth) : nullptr;
    const auto curtain = real != nullptr ? curtainFor(undisturbed, trunk.id, *real) : std::nullopt;
    if (!curtain)
      continue;
    const Flight flight = fly(sequence, curtain); // the same up to the curtain, so the id is the same too
    ++counts.trials;
    const auto stands = [&](const TrunkRecord &other) {
      return other.status == TrunkStatus::confirmed && truthOf(other, truth) == real;
    };
    const auto any = [&](bool same) {
      return std::any_of(flight.map.begin(), flight.map.end(),
                         [&](const TrunkRecord &other) { return (other.id == trunk.id) == same && stands(other); });
    };
    const bool is_back = viewsFrom(flight, curtain->end, trunk.id) >= kViewsBack && any(true);
    const bool is_other = any(false);
    counts.same_id += is_back;
    counts.other_id += !is_back && is_other;
    std::printf("%s: trunk %d (truth %d) hidden in frames %zu to %zu: %s\n", sequence.c_str(), trunk.id, real->id,
                curtain->first, curtain->end - 1,
                is_back    ? "back under its id"
                : is_other ? "back under another id"
                           : "not back");
    std::fflush(stdout);
  }
  return counts;
}
} // namespace

int main(int argc, char **argv)
{
  try {
    Counts all;
    for (const std::string &sequence : bole::test::flightsOf(argc, argv)) {
      const Counts counts = measure(sequence);
      all.trials += counts.trials;
      all.same_id += counts.same_id;
      all.other_id += counts.other_id;
    }
    std::printf("%d trunks hidden for %.0f s: %d back under their id, %d under another, %d not back\n", all.trials,
                kHidden_s, all.same_id, all.other_id, all.trials - all.same_id - all.other_id);
  }
  catch (const std::exception &error) {
    std::fprintf(stderr, "benchmark_reidentification: %s\n", error.what());
    return 1;
  }
  return 0;
}
