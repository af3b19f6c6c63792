// SPDX-License-Identifier: GPL-2.0-or-later
// How long after its parallax suffices is a trunk instantiated, and confirmed? It suffices from the frame on in which
// the trunk would count for recall if the flight ended there (VisibilityOptions: 8 frames in view, 3 degrees of
// bearing). Usage: benchmark_instantiation SEQUENCE... (the rendered flights where none is given).
#include "support/rendered_flights.h"

#include "evaluation/visibility.h"
#include "geometry/median.h"
#include "input/asl_source.h"
#include "pipeline/engine.h"
#include <bole/open_source.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace
{
using namespace bole;

constexpr double kMatch = 0.5; // [m], as the evaluation's

struct Life ///< of a trunk of the truth, in frames
{
  std::optional<std::size_t> suffices, candidate, confirmed;
};

/// Where \p trunk stands when the error of the newest pose is taken off.
Eigen::Vector2d placeOf(const Trunk &trunk, const Pose &estimate, const Pose &truth)
{
  return (truth * (estimate.inverse() * trunk.axisAt(kBreastHeight))).head<2>();
}

void note(std::optional<std::size_t> &first, std::size_t frame)
{
  if (!first)
    first = frame;
}

std::vector<Life> fly(const std::string &sequence)
{
  AslSource source(sequence);
  const std::vector<TruthTrunk> trees = readTruthTrunks(sequence);
  std::vector<Life> lives(trees.size());
  std::vector<Pose> truth;
  Engine pipeline(source.camera(), source.bMc(), stageOptions({}, source.camera()));
  for (std::size_t k = 0;; ++k) {
    Frame frame;
    if (!source.next(frame))
      return lives;
    truth.push_back(frame.wMb_truth.value());
    const Pose estimate = pipeline.process(frame).wMb;
    const auto visible = trunkVisibility(trees, truth, source.bMc(), source.camera());
    for (std::size_t i = 0; i < trees.size(); ++i) {
      if (visible[i].is_expected)
        note(lives[i].suffices, k);
      for (const MapTrunk &trunk : pipeline.trunks().trunks()) {
        if (trunk.removed || (placeOf(trunk.trunk, estimate, truth.back()) - trees[i].xy).norm() > kMatch)
          continue;
        note(lives[i].candidate, k);
        if (trunk.status == TrunkStatus::confirmed)
          note(lives[i].confirmed, k);
      }
    }
  }
}

/// Delays against the frame in which the parallax sufficed; negative: before.
struct Delays
{
  std::size_t expected = 0;
  std::vector<double> candidate, confirmed;

  void add(const Life &life)
  {
    if (!life.suffices)
      return;
    ++expected;
    const auto delay = [&life](std::size_t frame) {
      return static_cast<double>(frame) - static_cast<double>(*life.suffices);
    };
    if (life.candidate)
      candidate.push_back(delay(*life.candidate));
    if (life.confirmed)
      confirmed.push_back(delay(*life.confirmed));
  }
  void print(const std::string &name) const
  {
    const auto within = [this](const std::vector<double> &delays) {
      const auto soon = std::count_if(delays.begin(), delays.end(), [](double delay) { return delay <= 5; });
      return static_cast<double>(soon) / static_cast<double>(std::max<std::size_t>(expected, 1));
    };
    std::printf("| %s | %zu | %zu, %+.0f, %.2f | %zu, %+.0f, %.2f |\n", name.c_str(), expected, candidate.size(),
                medianOf(candidate), within(candidate), confirmed.size(), medianOf(confirmed), within(confirmed));
    std::fflush(stdout);
  }
};
} // namespace

int main(int argc, char **argv)
{
  try {
    std::printf(
        "| flight | trunks with parallax | instantiated: how many, median delay [frames], share within 5 frames | "
        "confirmed: the same |\n|---|---|---|---|\n");
    Delays all;
    for (const std::string &sequence : bole::test::flightsOf(argc, argv)) {
      Delays delays;
      for (const Life &life : fly(sequence)) {
        delays.add(life);
        all.add(life);
      }
      delays.print(std::filesystem::path(sequence).filename());
    }
    all.print("all");
  }
  catch (const std::exception &error) {
    std::fprintf(stderr, "benchmark_instantiation: %s\n", error.what());
    return 1;
  }
  return 0;
}
