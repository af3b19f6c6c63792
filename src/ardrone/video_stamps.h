// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// When the frames of the drone's video were, on a clock that only rises.

#include "ardrone/drone_clock.h"

namespace bole
{
/// Stamps frames by the drone's video clock; wraps and reboots do not stop it.
///
/// A clock that jumps by more than any link delays a packet is believed when two frames agree on
/// it: one alone may have a damaged stamp. Not thread-safe.
class VideoStamps
{
public:
  struct Stamp
  {
    std::int64_t ns = 0;
    bool is_measured = false; ///< by the drone; else a guess that rises
  };
  /// \param timestamp_ms nothing for an AR.Drone 1, which says nothing about time: then the arrival.
  Stamp next(const std::optional<std::uint32_t> &timestamp_ms, std::int64_t arrival_ns);
  /// Jumps so far: reboots.
  std::size_t jumps() const { return m_jumps; }

private:
  Stamp onDroneClock(std::int64_t raw_ns, std::int64_t arrival_ns);

  struct Jump
  {
    std::int64_t raw_ns, arrival_ns;
  };
  ClockUnwrapper m_unwrapper{kPaveTimePeriod_ms};
  std::int64_t m_shift_ns = 0, m_last_ns = 0, m_last_arrival_ns = 0;
  bool m_has_last = false;
  std::optional<Jump> m_jumped;
  std::size_t m_jumps = 0;
};
} // namespace bole
