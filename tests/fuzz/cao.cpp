// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as a model of trunks: refused with its name, or cylinders that can be drawn.
#include "file_of.h"

#include "mbt/model_files.h"

#include <visp3/core/vpException.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  const std::string path = bole::fuzz::fileOf(data, size, "model.cao");
  try {
    for (const bole::Cylinder &cylinder : bole::readCao(path))
      if (!(cylinder.radius > 0) || !cylinder.foot.allFinite() || !cylinder.top.allFinite())
        std::abort();
  }
  catch (const vpException &error) {
    bole::fuzz::requireNamed(error.getStringMessage(), path);
  }
  return 0;
}
