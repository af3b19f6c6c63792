// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/video_stamps.h"

#include <cstdlib>

namespace bole
{
namespace
{
constexpr std::int64_t kJump_ns = 5'000'000'000; // no link delays a packet so long
constexpr std::int64_t kBack_ns = 200'000'000;   // and none makes a clock run backwards
} // namespace

VideoStamps::Stamp VideoStamps::next(const std::optional<std::uint32_t> &timestamp_ms, std::int64_t arrival_ns)
{
  Stamp stamp =
      timestamp_ms ? onDroneClock(m_unwrapper.unwrap(*timestamp_ms) * 1'000'000, arrival_ns) : Stamp{arrival_ns, true};
  if (m_has_last && stamp.ns <= m_last_ns) // two in a burst, or a damaged stamp
    stamp = {m_last_ns + 1, false};
  m_has_last = true;
  m_last_ns = stamp.ns;
  m_last_arrival_ns = arrival_ns;
  return stamp;
}

VideoStamps::Stamp VideoStamps::onDroneClock(std::int64_t raw_ns, std::int64_t arrival_ns)
{
  const std::int64_t expected_ns = m_last_ns + arrival_ns - m_last_arrival_ns;
  const bool is_near = std::abs(raw_ns + m_shift_ns - expected_ns) <= kJump_ns;
  const bool went_back = raw_ns + m_shift_ns < m_last_ns - kBack_ns;
  if (!m_has_last || (is_near && !went_back)) {
    m_jumped.reset();
    return {raw_ns + m_shift_ns, true};
  }
  const bool agrees = m_jumped && std::abs(raw_ns - m_jumped->raw_ns - (arrival_ns - m_jumped->arrival_ns)) <= kJump_ns;
  if (agrees) {
    m_shift_ns = expected_ns - raw_ns;
    ++m_jumps;
    m_jumped.reset();
  }
  else {
    m_jumped = Jump{raw_ns, arrival_ns};
  }
  return {expected_ns, agrees};
}
} // namespace bole
