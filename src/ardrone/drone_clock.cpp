// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/drone_clock.h"

#include <algorithm>
#include <cstdlib>

namespace bole
{
namespace
{
constexpr double kDrift = 200e-6;                // largest of two cheap quartz clocks [s/s]
constexpr double kSettle_s = 0.3;                // until some packet will have come without delay
constexpr std::int64_t kJump_ns = 5'000'000'000; // no link delays a packet so long
constexpr std::int64_t kBack_ns = 200'000'000;   // and none makes a clock run backwards
} // namespace

std::int64_t ClockUnwrapper::unwrap(std::int64_t stamp)
{
  if (!m_last) {
    m_last = stamp;
    return stamp;
  }
  std::int64_t step = (stamp - *m_last) % m_period;
  if (step > m_period / 2)
    step -= m_period;
  if (step < -(m_period / 2))
    step += m_period;
  m_last = *m_last + step;
  return *m_last;
}

std::int64_t navdataTimeMicroseconds(std::uint32_t time)
{
  return std::int64_t{time >> 21} * 1'000'000 + (time & 0x1fffff);
}

bool ClockFit::add(std::int64_t drone_ns, std::int64_t host_ns)
{
  const std::int64_t offset = host_ns - drone_ns;
  const bool first = !m_offset_ns;
  const bool jump = !first && std::abs(offset - *m_offset_ns) > kJump_ns;
  if (first || jump) {
    m_offset_ns = offset;
    m_first_host_ns = host_ns;
  }
  else {
    const double elapsed_ns = static_cast<double>(std::max<std::int64_t>(0, host_ns - m_last_host_ns));
    *m_offset_ns = std::min(offset, *m_offset_ns + static_cast<std::int64_t>(kDrift * elapsed_ns));
  }
  m_last_host_ns = host_ns;
  return !jump;
}

bool ClockFit::isReady() const
{
  return m_offset_ns && static_cast<double>(m_last_host_ns - m_first_host_ns) * 1e-9 >= kSettle_s;
}

void ClockRate::add(std::int64_t drone_ns, std::int64_t host_ns)
{
  constexpr std::int64_t kSpacing_ns = 50'000'000, kWindow_ns = 3'000'000'000;
  if (!m_instants.empty() && host_ns - m_instants.back().host_ns < kSpacing_ns)
    return;
  m_instants.push_back({drone_ns, host_ns});
  while (m_instants.size() > 2 && host_ns - m_instants[1].host_ns >= kWindow_ns)
    m_instants.pop_front();
}

std::optional<double> ClockRate::rate() const
{
  constexpr std::int64_t kLeast_ns = 2'900'000'000;
  if (m_instants.size() < 10)
    return std::nullopt;
  const std::int64_t host_ns = m_instants.back().host_ns - m_instants.front().host_ns;
  if (host_ns < kLeast_ns)
    return std::nullopt;
  return static_cast<double>(m_instants.back().drone_ns - m_instants.front().drone_ns) / static_cast<double>(host_ns);
}

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
