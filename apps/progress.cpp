// SPDX-License-Identifier: GPL-2.0-or-later
#include "progress.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <unistd.h>

namespace bole
{
namespace
{
/// "1:05" of 65 s.
std::string clockText(double seconds)
{
  const auto whole = static_cast<long>(std::lround(seconds));
  return whole < 3600 ? fmt::format("{}:{:02}", whole / 60, whole % 60)
                      : fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}
} // namespace

Progress::Progress(std::size_t total, std::FILE *stream, std::string noun)
    : m_total(total),
      m_stream(stream),
      m_noun(std::move(noun)),
      m_is_shown(isatty(fileno(stream)) == 1),
      m_start(Clock::now()),
      m_last_print(m_start)
{
}

Progress::~Progress() { finish(); }

std::string Progress::text(std::size_t done, std::size_t total, double seconds, const std::string &noun,
                           const std::string &remark)
{
  std::string text;
  if (total > 0) {
    constexpr std::size_t kWidth = 28;
    const std::size_t filled = std::min(kWidth, kWidth * done / total);
    text = "[" + std::string(filled, '#') + std::string(kWidth - filled, '.') + "] ";
  }
  text += total > 0 ? fmt::format("{} {} of {}", noun, done, total) : fmt::format("{} {}", noun, done);
  const double rate = seconds > 0 ? static_cast<double>(done) / seconds : 0;
  if (rate > 0)
    text += fmt::format("  {:.1f} {}s/s", rate, noun);
  if (rate > 0 && done < total)
    text += fmt::format("  {} left", clockText(static_cast<double>(total - done) / rate));
  return remark.empty() ? text : text + "  " + remark;
}

void Progress::print()
{
  const double seconds = std::chrono::duration<double>(Clock::now() - m_start).count();
  std::fprintf(m_stream, "\r\033[K%s", text(m_done, m_total, seconds, m_noun, m_remark).c_str());
  std::fflush(m_stream);
  m_is_open = true;
  m_printed = m_done;
  m_last_print = Clock::now();
}

void Progress::update(std::size_t done, const std::string &remark)
{
  constexpr double kInterval_s = 0.1;
  m_done = done;
  m_remark = remark;
  if (m_is_shown && std::chrono::duration<double>(Clock::now() - m_last_print).count() >= kInterval_s)
    print();
}

void Progress::finish()
{
  if (m_is_shown && m_done > m_printed)
    print();
  if (m_is_open)
    std::fputc('\n', m_stream);
  m_is_open = false;
}
} // namespace bole
