// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
#include "support/files.h"

#include <cstdint>

namespace bole::test
{
/// A file captured from a real drone; empty where the captures are not on this machine.
inline std::vector<std::uint8_t> captured(const std::string &name)
{
  const std::string bytes = textOf(std::string(BOLE_SHARED_DATA_DIR) + "/ardrone/" + name);
  return {bytes.begin(), bytes.end()};
}
} // namespace bole::test
