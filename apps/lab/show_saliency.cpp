// SPDX-License-Identifier: GPL-2.0-or-later
// bole show-saliency: saliency beside its images (Fig. 8 of the paper).
#include "lab_commands.h"

#include "support/text.h"
#include <bole/open_source.h>
#include <bole/pipeline.h>

#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <memory>
#include <string>
#include <visp3/io/vpImageIo.h>

namespace bole::apps
{
namespace
{
struct ShowArguments
{
  std::string sequence, output = "saliency";
  int first = 20, every = 20;
};

/// Image left, saliency right: white is near, black far, grey unknown.
vpImage<unsigned char> beside(const vpImage<unsigned char> &image, const SaliencyField &saliency)
{
  vpImage<unsigned char> both(image.getHeight(), 2 * image.getWidth());
  for (unsigned v = 0; v < image.getHeight(); ++v)
    for (unsigned u = 0; u < image.getWidth(); ++u) {
      both[v][u] = image[v][u];
      const float near = saliency.isKnown(v, u) ? 1 - saliency.p_background[v][u] : 0.5f;
      both[v][u + image.getWidth()] = static_cast<unsigned char>(255 * near);
    }
  return both;
}

void show(const ShowArguments &arguments)
{
  const auto source = openSource(arguments.sequence);
  std::filesystem::create_directories(arguments.output);
  Options options;
  options.camera.compressed = source->isCompressed();
  options.stages.final_pass = false;
  Pipeline pipeline(source->camera(), source->bMc(), options);
  int pictures = 0;
  for (Frame frame; source->next(frame);) {
    const FrameReport report = pipeline.process(frame);
    const int index = static_cast<int>(frame.index);
    if (!report.saliency || index < arguments.first || (index - arguments.first) % arguments.every != 0)
      continue;
    const std::string path = fmt::format("{}/saliency-{:05d}.png", arguments.output, index);
    vpImageIo::write(beside(frame.image, *report.saliency), path);
    std::printf("%s\n", path.c_str());
    ++pictures;
  }
  std::printf("%d pictures in %s\n", pictures, arguments.output.c_str());
}
} // namespace

void addShowSaliency(CLI::App &app)
{
  auto arguments = std::make_shared<ShowArguments>();
  CLI::App *command = app.add_subcommand("show-saliency", "Draw saliency beside the images of a sequence");
  command->add_option("SEQUENCE", arguments->sequence, "ASL folder, video or numbered images")->required();
  command->add_option("-o,--output", arguments->output, "Folder for the pictures")->capture_default_str();
  command->add_option("--first", arguments->first, "First frame that is drawn")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  command->add_option("--every", arguments->every, "Frames from picture to picture")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->footer("White is near (or moves unlike the background), black is far, grey is unknown.\n"
                  "Example:\n  bole show-saliency flights/park-forward -o pictures --every 40");
  command->callback([arguments] { show(*arguments); });
}
} // namespace bole::apps
