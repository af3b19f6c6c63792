// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes, cut anywhere, through the PaVE parser and the H.264 decoder behind it.
#include "ardrone/video_decoder.h"

#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  if (size == 0)
    return 0;
  const std::size_t piece = 1 + data[0] * 8u;
  bole::DroneVideoDecoder decoder(2);
  bole::PaveParser parser;
  std::size_t used = 0;
  for (std::size_t at = 1; at < size; at += piece) {
    const std::size_t length = std::min(piece, size - at);
    decoder.decode(data + at, length);
    parser.push(data + at, length);
    while (auto frame = parser.next())
      used += frame->header.header_size + frame->payload.size();
  }
  if (used + parser.skippedBytes() > size)
    std::abort(); // no byte may be used twice
  return 0;
}
