// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/injected_fault.h"

#include "geometry/require_range.h"

#include <visp3/core/vpException.h>

namespace bole
{
const char *toString(FaultKind kind)
{
  switch (kind) {
  case FaultKind::none:
    return "none";
  case FaultKind::black:
    return "black";
  case FaultKind::freeze:
    return "freeze";
  case FaultKind::noise:
    return "noise";
  }
  return "?";
}

FaultKind faultKindFromString(const std::string &word)
{
  for (FaultKind kind : {FaultKind::none, FaultKind::black, FaultKind::freeze, FaultKind::noise})
    if (word == toString(kind))
      return kind;
  throw vpException(vpException::badValue, "fault = %s, must be none, black, freeze or noise", word.c_str());
}

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
  switch (m_options.kind) {
  case FaultKind::black:
    frame.image = 0;
    break;
  case FaultKind::freeze:
    frame.image = m_last;
    break;
  case FaultKind::noise:
    for (unsigned i = 0; i < frame.image.getSize(); ++i)
      frame.image.bitmap[i] = static_cast<unsigned char>(m_random.next() >> 56);
    break;
  case FaultKind::none:
    break;
  }
  return true;
}
} // namespace bole
