// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far a long run is.

#include <chrono>
#include <cstdio>
#include <string>

namespace bole
{
/// A bar that is redrawn in place on a terminal, a line every few seconds elsewhere.
class Progress
{
public:
  /// \param frames of the whole run, 0 when not known; \p stream is stderr in programs.
  Progress(std::size_t frames, std::FILE *stream, double seconds_between_lines = 5);
  ~Progress(); ///< ends the line of the bar

  /// \p frame frames are done, \p trunks are confirmed; \p remark may be empty.
  void update(std::size_t frame, std::size_t trunks, const std::string &remark = {});
  void finish();

  /// The text of the bar or line.
  static std::string text(std::size_t frame, std::size_t frames, double frames_per_second, std::size_t trunks,
                          const std::string &remark, bool is_terminal);

private:
  using Clock = std::chrono::steady_clock;
  void print(std::size_t frame, std::size_t trunks, const std::string &remark);

  std::size_t m_frames;
  std::FILE *m_stream;
  double m_interval_s;
  bool m_is_terminal;
  bool m_is_open = false; ///< a bar stands on the current line
  std::size_t m_last_frame = 0, m_last_trunks = 0, m_printed_frame = 0;
  Clock::time_point m_start, m_last_print;
};
} // namespace bole
