// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Commands as a user runs them: what they print and how they end.

#include <array>
#include <cstdio>
#include <string>
#include <sys/wait.h>

namespace bole::test
{
struct Outcome
{
  int status = 0;   ///< exit status; 128 and more: ended by a signal
  std::string text; ///< standard output and error together
};

inline Outcome runShell(const std::string &command)
{
  Outcome outcome;
  FILE *pipe = popen(("( " + command + " ) 2>&1").c_str(), "r");
  std::array<char, 4096> buffer;
  while (const std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe))
    outcome.text.append(buffer.data(), n);
  const int status = pclose(pipe);
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}
} // namespace bole::test
