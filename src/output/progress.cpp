// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/progress.h"

#include <algorithm>
#include <fmt/format.h>
#include <unistd.h>

namespace bole
{
Progress::Progress(std::size_t frames, std::FILE *stream, double seconds_between_lines)
    : m_frames(frames),
      m_stream(stream),
      m_is_terminal(isatty(fileno(stream)) == 1),
      m_start(Clock::now()),
      m_last_print(m_start)
{
  m_interval_s = m_is_terminal ? 0.1 : seconds_between_lines;
}

Progress::~Progress() { finish(); }

std::string Progress::text(std::size_t frame, std::size_t frames, double frames_per_second, std::size_t trunks,
                           const std::string &remark, bool is_terminal)
{
  std::string text;
  if (frames > 0 && is_terminal) {
    constexpr std::size_t kWidth = 28;
    const std::size_t done = std::min(kWidth, kWidth * frame / frames);
    text = "[" + std::string(done, '#') + std::string(kWidth - done, '.') + "] ";
  }
  text += frames > 0 ? fmt::format("frame {} of {}", frame, frames) : fmt::format("frame {}", frame);
  text += fmt::format("  {:.1f} frames/s  {} trunk{}", frames_per_second, trunks, trunks == 1 ? "" : "s");
  return remark.empty() ? text : text + "  " + remark;
}

void Progress::print(std::size_t frame, std::size_t trunks, const std::string &remark)
{
  const double seconds = std::chrono::duration<double>(Clock::now() - m_start).count();
  const double rate = seconds > 0 ? static_cast<double>(frame) / seconds : 0;
  const std::string line = text(frame, m_frames, rate, trunks, remark, m_is_terminal);
  std::fprintf(m_stream, m_is_terminal ? "\r\033[K%s" : "%s\n", line.c_str());
  std::fflush(m_stream);
  m_is_open = m_is_terminal;
  m_printed_frame = frame;
  m_last_print = Clock::now();
}

void Progress::update(std::size_t frame, std::size_t trunks, const std::string &remark)
{
  m_last_frame = frame;
  m_last_trunks = trunks;
  if (std::chrono::duration<double>(Clock::now() - m_last_print).count() >= m_interval_s)
    print(frame, trunks, remark);
}

void Progress::finish()
{
  if (m_last_frame > m_printed_frame)
    print(m_last_frame, m_last_trunks, {});
  if (m_is_open)
    std::fputc('\n', m_stream);
  m_is_open = false;
}
} // namespace bole
