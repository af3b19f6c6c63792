// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/drone_clock.h"
#include "geometry/failure.h"

#include <algorithm>
#include <bole/visp.h>
#include <cstdlib>

namespace bole
{
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

std::uint32_t navdataTimeWord(std::int64_t microseconds)
{
  std::int64_t reduced = microseconds % kNavdataTimePeriod_us;
  if (reduced < 0)
    reduced += kNavdataTimePeriod_us;
  return static_cast<std::uint32_t>(reduced / 1'000'000) << 21 | static_cast<std::uint32_t>(reduced % 1'000'000);
}

void ClockFit::Options::validate() const
{
  requireRange("drift", drift, 1e-6, 1e-2);
  requireRange("jump_s", jump_s, 0.1, 100);
  requireRange("settle_s", settle_s, 0, 60);
}

ClockFit::ClockFit() : ClockFit(Options{}) {}
ClockFit::ClockFit(const Options &options) : m_options(options) { m_options.validate(); }

bool ClockFit::add(std::int64_t drone_ns, std::int64_t host_ns)
{
  const std::int64_t offset = host_ns - drone_ns;
  const bool first = !m_offset_ns;
  const bool jump = !first && std::abs(static_cast<double>(offset - *m_offset_ns)) > m_options.jump_s * 1e9;
  if (first || jump) {
    m_offset_ns = offset;
    m_first_host_ns = host_ns;
  }
  else {
    const double elapsed_ns = static_cast<double>(std::max<std::int64_t>(0, host_ns - m_last_host_ns));
    *m_offset_ns = std::min(offset, *m_offset_ns + static_cast<std::int64_t>(m_options.drift * elapsed_ns));
  }
  m_last_host_ns = host_ns;
  return !jump;
}

bool ClockFit::isReady() const
{
  return m_offset_ns && static_cast<double>(m_last_host_ns - m_first_host_ns) * 1e-9 >= m_options.settle_s;
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
} // namespace bole
