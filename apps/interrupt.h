// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Ctrl-C, a request to end, a closed terminal and a reader that went away end a command after the present step, so
/// that what is known by then is kept.

#include <csignal>
#include <initializer_list>

namespace bole::apps
{
inline volatile std::sig_atomic_t g_interrupted = 0;

/// From here on these signals are noted; interrupted() tells. A second Ctrl-C ends the process at once. SIGXFSZ is
/// ignored: a file that grows beyond the limit is then an error of writing, which the writer reports. A signal that
/// whoever started the command ignores (nohup) stays ignored.
inline void endAtInterrupt()
{
  struct sigaction action = {};
  action.sa_handler = [](int) { g_interrupted = 1; };
  for (const int signal : {SIGTERM, SIGHUP, SIGPIPE, SIGINT}) {
    struct sigaction before = {};
    sigaction(signal, nullptr, &before);
    action.sa_flags = signal == SIGINT ? static_cast<int>(SA_RESETHAND) : 0;
    if (before.sa_handler != SIG_IGN)
      sigaction(signal, &action, nullptr);
  }
  std::signal(SIGXFSZ, SIG_IGN);
}
inline bool interrupted() { return g_interrupted != 0; }
} // namespace bole::apps
