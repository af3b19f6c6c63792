// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as an image: a status with a reason, or an image of the size that was asked for. Never an exception.
#include "file_of.h"

#include "input/frame_builder.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  const std::string path = bole::fuzz::fileOf(data, size, "image.png");
  const bole::ImageFile file = bole::readImageFile(path, 64, 48);
  if (file.status == bole::FrameStatus::ok ? file.image.getWidth() != 64 || file.image.getHeight() != 48
                                           : file.message.empty() || file.image.getSize() != 0)
    std::abort();
  return 0;
}
