// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as a file of options: refused with its name, or options that every stage accepts and that can be written.
#include "file_of.h"

#include "pipeline/stage_options.h"
#include <bole/config.h>

#include <visp3/core/vpException.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  const std::string path = bole::fuzz::fileOf(data, size, "options.yaml");
  bole::Options options;
  try {
    bole::readConfig(path, options);
  }
  catch (const vpException &error) {
    bole::fuzz::requireNamed(error.getStringMessage(), path);
    return 0;
  }
  bole::stageOptions(options, bole::PinholeCamera());
  const std::string text = bole::toYaml(options);
  bole::Options again;
  bole::readConfig(bole::fuzz::fileOf(reinterpret_cast<const std::uint8_t *>(text.data()), text.size(), "again.yaml"),
                   again);
  if (bole::toYaml(again) != text)
    std::abort();
  return 0;
}
