// SPDX-License-Identifier: GPL-2.0-or-later
// bole fit-odds: the weights by which the final pass tells trunks.
#include "commands.h"

#include "lab/odds/logistic.h"
#include "lab/odds/samples.h"
#include "output/progress.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <functional>
#include <memory>
#include <visp3/core/vpException.h>

namespace bole::apps
{
namespace
{
struct FitArguments
{
  std::string flights, runs;
};

struct Samples
{
  Eigen::MatrixXd terms;
  Eigen::VectorXd truth;
};

Samples gather(const std::vector<std::vector<OddsSample>> &flights, const std::function<bool(std::size_t)> &isTaken)
{
  std::vector<OddsSample> all;
  for (std::size_t i = 0; i < flights.size(); ++i)
    if (isTaken(i))
      all.insert(all.end(), flights[i].begin(), flights[i].end());
  Samples samples{Eigen::MatrixXd(all.size(), EvidenceTerms::RowsAtCompileTime), Eigen::VectorXd(all.size())};
  for (std::size_t i = 0; i < all.size(); ++i) {
    samples.terms.row(static_cast<Eigen::Index>(i)) = all[i].terms.transpose();
    samples.truth(static_cast<Eigen::Index>(i)) = all[i].is_trunk ? 1 : 0;
  }
  return samples;
}

void fit(const FitArguments &arguments)
{
  constexpr std::size_t kFolds = 6;
  std::vector<std::string> names;
  for (const auto &entry : std::filesystem::directory_iterator(arguments.runs))
    if (std::filesystem::exists(entry.path() / "trajectory.tum"))
      names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  if (names.size() < kFolds)
    throw vpException(vpException::badValue,
                      fmt::format("{}: {} runs, must be {} or more", arguments.runs, names.size(), kFolds));
  std::vector<std::vector<OddsSample>> flights;
  Progress progress(names.size(), stderr, "flight");
  for (const std::string &name : names) {
    flights.push_back(oddsSamples(arguments.runs + "/" + name, arguments.flights + "/" + name));
    progress.update(flights.size());
  }
  progress.finish();

  const Samples all = gather(flights, [](std::size_t) { return true; });
  Eigen::VectorXd unseen(all.truth.size()), truth(all.truth.size()); // each flight by the weights of the others
  Eigen::Index at = 0;
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    const Samples taught = gather(flights, [&](std::size_t i) { return i % kFolds != fold; }),
                  tried = gather(flights, [&](std::size_t i) { return i % kFolds == fold; });
    unseen.segment(at, tried.truth.size()) = tried.terms * fitLogistic(taught.terms, taught.truth);
    truth.segment(at, tried.truth.size()) = tried.truth;
    at += tried.truth.size();
  }
  std::printf("%zu flights, %ld hypotheses, %.0f of them trunks\n", names.size(), static_cast<long>(truth.size()),
              truth.sum());
  std::printf("area under the ROC curve, flights that were left out: %.3f\n", areaUnderRoc(unseen, truth));
  std::printf("said  was  count\n");
  for (const ReliabilityBin &bin : reliability(unseen, truth))
    std::printf("%.2f  %.2f  %d\n", bin.said, bin.was, bin.count);
  const Eigen::VectorXd weights = fitLogistic(all.terms, all.truth);
  for (Eigen::Index i = 0; i < weights.size(); ++i)
    std::printf("%6.2f, // %s\n", weights(i), kEvidenceTermNames[i]);
}
} // namespace

void addFitOdds(CLI::App &app)
{
  const auto arguments = std::make_shared<FitArguments>();
  CLI::App *command = app.add_subcommand("fit-odds", "Fit the weights by which the final pass tells trunks");
  command->add_option("FLIGHTS", arguments->flights, "Folder of simulated flights")->required();
  command->add_option("RUNS", arguments->runs, "Folder of their runs, each under the name of its flight")->required();
  command->footer("Prints the weights for src/detection/trunk_evidence.cpp, and how good they are on flights that are "
                  "left out.\nExample:\n  bole fit-odds flights runs");
  command->callback([arguments] { fit(*arguments); });
}
} // namespace bole::apps
