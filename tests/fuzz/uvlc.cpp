// SPDX-License-Identifier: GPL-2.0-or-later
// Any datagram through the UVLC decoder.
#include "ardrone/uvlc.h"

#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  const bole::UvlcResult result = bole::decodeUvlc(data, size);
  const auto pixels = static_cast<std::size_t>(result.picture.width) * static_cast<std::size_t>(result.picture.height);
  if (result.picture.y.size() != pixels || (result.whole && pixels == 0))
    std::abort();
  vpImage<vpRGBa> colour;
  if (!result.picture.empty() && pixels <= 320 * 240)
    result.picture.toColour(colour);
  return 0;
}
