// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Ctrl-C ends a live command at the next frame, so that its files are closed.

#include <csignal>

namespace bole::apps
{
inline volatile std::sig_atomic_t g_interrupted = 0;

inline void endAtInterrupt()
{
  const auto handler = [](int) { g_interrupted = 1; };
  std::signal(SIGINT, handler);
  std::signal(SIGTERM, handler);
}
inline bool interrupted() { return g_interrupted != 0; }
} // namespace bole::apps
