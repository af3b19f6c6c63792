// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace bole::test
{
/// A file captured from a real drone; empty where the captures are not on this machine.
inline std::vector<std::uint8_t> captured(const std::string &name)
{
  std::ifstream file(std::string(BOLE_SHARED_DATA_DIR) + "/ardrone/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}
} // namespace bole::test
