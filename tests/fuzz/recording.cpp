// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as a recording; and as commands, the other text that comes from outside.
#include "emulator/recording_reader.h"
#include "emulator/wire_format.h"

#include <cstdlib>
#include <string>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  bole::RecordingReader reader(std::vector<std::uint8_t>(data, data + size));
  std::size_t used = 0;
  for (bole::RecordedPiece piece; reader.next(piece);)
    used += piece.bytes.size() + 24;
  if (used + reader.skippedBytes() != size)
    std::abort(); // every byte is read or skipped
  bole::parseAtCommands(std::string(data, data + size));
  return 0;
}
