// SPDX-License-Identifier: GPL-2.0-or-later
// bole calibrate-saliency: noise parameters of the saliency stage from a sequence.
#include "commands.h"
#include "saliency_run.h"

#include "output/atomic_file.h"
#include "output/progress.h"
#include "saliency/noise_learner.h"

#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <string>
#include <visp3/core/vpException.h>

namespace bole::apps
{
namespace
{
struct CalibrateArguments
{
  std::string sequence, output = "saliency.yaml";
};

void calibrate(const CalibrateArguments &arguments)
{
  const auto source = openSource(arguments.sequence);
  const SaliencyOptions start;
  SaliencyRun run(*source, start);
  SaliencyNoiseLearner learner(source->camera(), start);
  Progress progress(source->size(), stderr);
  std::size_t frames = 0;
  while (run.next()) {
    if (frames > 0)
      learner.add(run.previous_image, run.frame.image, run.saliency);
    progress.update(++frames);
  }
  progress.finish();
  if (learner.count() == 0)
    throw vpException(vpException::badValue,
                      fmt::format("{}: no pair of images with texture to learn from", arguments.sequence).c_str());
  const SaliencyOptions learnt = learner.learnt();
  const std::string text =
      fmt::format("# learnt by bole calibrate-saliency from {} ({} frames, {} pixels with texture)\n"
                  "saliency:\n  sigma_intensity: {:.4f}\n  sigma_background_px: {:.3f}\n"
                  "  sigma_foreground_px: {:.3f}\n  background_prior: {:.3f}\n",
                  source->name(), frames, learner.count(), learnt.sigma_intensity, learnt.sigma_background_px,
                  learnt.sigma_foreground_px, learnt.background_prior);
  writeAtomically(arguments.output, text);
  std::printf("%s", text.c_str());
}
} // namespace

void addCalibrateSaliency(CLI::App &app)
{
  auto arguments = std::make_shared<CalibrateArguments>();
  CLI::App *command =
      app.add_subcommand("calibrate-saliency", "Learn the noise parameters of saliency from a sequence");
  command->add_option("SEQUENCE", arguments->sequence, "ASL folder, video or numbered images")->required();
  command->add_option("-o,--output", arguments->output, "Configuration file to write")->capture_default_str();
  command->footer("Example:\n  bole calibrate-saliency flights/park-forward -o saliency.yaml");
  command->callback([arguments] { calibrate(*arguments); });
}
} // namespace bole::apps
