// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as a video: refused with its name, or pictures whose stamps rise.
#include "file_of.h"

#include "input/video_file.h"

#include <visp3/core/vpException.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  constexpr int kMost = 200; // pictures: a damaged container may count millions
  const std::string path = bole::fuzz::fileOf(data, size, "video.avi");
  try {
    bole::VideoFile video(path);
    std::int64_t last_ns = -1;
    bole::Picture picture;
    for (int count = 0; count < kMost && video.next(picture); ++count) {
      if (picture.stamp_ns <= last_ns)
        std::abort();
      last_ns = picture.stamp_ns;
    }
  }
  catch (const vpException &error) {
    bole::fuzz::requireNamed(error.getStringMessage(), path);
  }
  return 0;
}
