// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The flights that a benchmark measures.

#include <string>
#include <vector>

namespace bole::test
{
/// Those named on the command line, or else the three rendered ones.
inline std::vector<std::string> flightsOf(int argc, char **argv)
{
  std::vector<std::string> flights(argv + 1, argv + argc);
  if (flights.empty())
    for (const char *name : {"park-forward", "winter-weave", "pine-arc"})
      flights.push_back(std::string(BOLE_SHARED_DATA_DIR) + "/rendered/" + name);
  return flights;
}
} // namespace bole::test
