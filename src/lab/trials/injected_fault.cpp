// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/injected_fault.h"

#include "geometry/require_range.h"

namespace bole
{
void FaultOptions::validate() const
{
  requireRange("fault start_s", start_s, 0, 3600);
  requireRange("fault duration_s", duration_s, 0.05, 3600);
}

FaultInjector::FaultInjector(const FaultOptions &options, std::uint64_t seed) : m_options(options), m_random(seed, 601)
{
  options.validate();
}

bool FaultInjector::apply(Frame &frame, double servoing_s)
{
  const bool is_now = m_options.kind != FaultKind::none && servoing_s >= m_options.start_s &&
                      servoing_s < m_options.start_s + m_options.duration_s;
  if (!is_now) {
    m_last = frame.image;
    return false;
  }
  spoil(frame.image, m_options.kind, m_last, unsigned(m_random.next() >> 32));
  return true;
}
} // namespace bole
