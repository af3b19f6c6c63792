// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Time as it passes: the clock that arrivals are stamped with, and how long one waits before an attempt that failed is
/// made again.

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace bole
{
inline std::int64_t steadyNowNs()
{
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Twice as long after each attempt, up to a limit, so that nobody who closes at once is asked thousands of times.
class RetryPause
{
public:
  RetryPause(double first_s, double longest_s) : m_first(first_s), m_longest(longest_s), m_next(first_s) {}

  std::chrono::duration<double> next()
  {
    const auto pause = m_next;
    m_next = std::min(2 * m_next, m_longest);
    return pause;
  }
  /// After an attempt that succeeded.
  void reset() { m_next = m_first; }

private:
  std::chrono::duration<double> m_first, m_longest, m_next;
};
} // namespace bole
