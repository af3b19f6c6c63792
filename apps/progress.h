// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far a long run is, and how it is ended.

#include <chrono>
#include <csignal>
#include <cstdio>
#include <initializer_list>
#include <string>

namespace bole
{
/// A bar that is redrawn in place on a terminal; nothing elsewhere, where it would only fill a log.
class Progress
{
public:
  /// \param total steps of the whole run, 0 when not known; \p noun names a step; \p stream is stderr in programs.
  Progress(std::size_t total, std::FILE *stream, std::string noun = "frame");
  ~Progress(); ///< ends the line of the bar

  /// \p done steps are done; \p remark may be empty.
  void update(std::size_t done, const std::string &remark = {});
  void finish();

  /// The text of the bar after \p seconds.
  static std::string text(std::size_t done, std::size_t total, double seconds, const std::string &noun,
                          const std::string &remark);

private:
  using Clock = std::chrono::steady_clock;
  void print();

  std::size_t m_total, m_done = 0, m_printed = 0;
  std::FILE *m_stream;
  std::string m_noun, m_remark;
  bool m_is_shown;        ///< on a terminal
  bool m_is_open = false; ///< a bar stands on the current line
  Clock::time_point m_start, m_last_print;
};
} // namespace bole

namespace bole::apps
{
inline volatile std::sig_atomic_t g_interrupted = 0;

/// Ctrl-C, a request to end, a closed terminal and a reader that went away end a command after the present step, so
/// that what is known by then is kept: from here on these signals are noted, and interrupted() tells. A second Ctrl-C
/// ends the process at once. SIGXFSZ is ignored: a file that grows beyond the limit is then an error of writing, which
/// the writer reports. A signal that whoever started the command ignores (nohup) stays ignored.
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
