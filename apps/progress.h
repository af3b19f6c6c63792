// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far a long run is.

#include <chrono>
#include <cstdio>
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
