// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
#include "support/files.h"

#include <cstdint>
#include <visp3/core/vpImage.h>

namespace bole::test
{
/// A file captured from a real drone; empty where the captures are not on this machine.
inline std::vector<std::uint8_t> captured(const std::string &name)
{
  const std::string bytes = textOf(std::string(BOLE_SHARED_DATA_DIR) + "/ardrone/" + name);
  return {bytes.begin(), bytes.end()};
}

/// Slanting stripes of many greys.
inline vpImage<unsigned char> stripes(unsigned width, unsigned height, int shift)
{
  vpImage<unsigned char> image(height, width);
  for (unsigned v = 0; v < height; ++v)
    for (unsigned u = 0; u < width; ++u)
      image[v][u] = static_cast<unsigned char>((u * 7 + v * 3 + static_cast<unsigned>(shift) * 5) % 251);
  return image;
}
} // namespace bole::test
