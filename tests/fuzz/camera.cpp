// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as a camera file, YAML or XML: refused with its name, or a camera that can be one.
#include "file_of.h"

#include "input/camera_plausibility.h"
#include "input/frame_builder.h"

#include <visp3/core/vpException.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  if (size == 0)
    return 0;
  const std::string path = bole::fuzz::fileOf(data + 1, size - 1, data[0] % 4 == 0 ? "camera.xml" : "camera.yaml");
  try {
    const bole::MountedCamera camera = bole::readCamera(path, 320, 240);
    if (bole::implausibility(camera).part != bole::Implausibility::Part::none || !camera.bMc.isFinite())
      std::abort();
    if (camera.model.pinhole.width > 640 || camera.model.pinhole.height > 480)
      return 0;
    bole::Rectifier rectifier(camera.model, 320);
    if (!(rectifier.camera().fx > 0) || rectifier.camera().width < 1)
      std::abort();
  }
  catch (const vpException &error) {
    bole::fuzz::requireNamed(error.getStringMessage(), path);
  }
  return 0;
}
