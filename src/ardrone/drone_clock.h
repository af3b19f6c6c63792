// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The drone's clocks: unwrapped, and fitted to the host's.

#include <bole/ardrone_wire.h>

#include <deque>

namespace bole
{
/// Turns a counter that wraps into one that does not.
///
/// A stamp is taken as the nearest to the one before: up to half the period ahead or behind, so packets out of order
/// are no wrap. Law (a test): differences of stamps less than half a period apart are exact.
class ClockUnwrapper
{
public:
  /// \param period of the counter, in its unit.
  explicit ClockUnwrapper(std::int64_t period) : m_period(period) {}
  std::int64_t unwrap(std::int64_t stamp);
  void reset() { m_last.reset(); }

private:
  std::int64_t m_period;
  std::optional<std::int64_t> m_last;
};

/// Microseconds in the navdata's time word: 11 bits of seconds, 21 bits of microseconds.
std::int64_t navdataTimeMicroseconds(std::uint32_t time);

/// Offset between a drone's clock and the host's, from packets that arrive late by an unknown, varying time.
///
/// Idea: arrival minus stamp is the offset plus a delay that is never negative, so its running minimum is the offset
/// plus the shortest delay. The minimum is let rise by the largest drift between two quartz clocks, so that it follows
/// one that falls behind. A jump beyond what any link delays is a reboot: it starts anew.
class ClockFit
{
public:
  /// \return false when the drone's clock jumped and the fit began anew.
  bool add(std::int64_t drone_ns, std::int64_t host_ns);
  /// Whether it has seen enough packets: before, the offset may hold the delay of the first.
  bool isReady() const;
  std::int64_t toHost(std::int64_t drone_ns) const { return drone_ns + m_offset_ns.value_or(0); }
  std::int64_t toDrone(std::int64_t host_ns) const { return host_ns - m_offset_ns.value_or(0); }
  void reset() { m_offset_ns.reset(); }

private:
  std::optional<std::int64_t> m_offset_ns;
  std::int64_t m_first_host_ns = 0, m_last_host_ns = 0;
};

/// How fast a drone's clock runs against the host's, over the last three seconds of arrivals.
class ClockRate
{
public:
  void add(std::int64_t drone_ns, std::int64_t host_ns);
  /// Drone's seconds a host's second; nothing before three seconds of packets.
  std::optional<double> rate() const;

private:
  struct Instant
  {
    std::int64_t drone_ns, host_ns;
  };
  std::deque<Instant> m_instants; ///< at most one every 50 ms
};

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
