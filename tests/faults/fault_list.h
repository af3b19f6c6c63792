// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The faults of the table, by group: pictures, sensors, files, options, process.

#include "spoilt_flight.h"

#include <string>
#include <vector>

namespace bole::faults
{
constexpr std::size_t kAt = 50;         ///< frame at which a fault begins
constexpr double kRate_hz = 10;         ///< of the flight
constexpr std::size_t kToTheEnd = 1000; ///< frames

/// What a good program does about a fault.
enum class Duty
{
  survive, ///< maps as well as without it, or names it within a second
  read,    ///< another dialect of the same: the same bytes
  refuse,  ///< one line that names it, and no run
  keep     ///< a process that ends early: what a function of its own looks at
};

/// Where a fault of the process is tried.
struct Shop
{
  std::string bole;   ///< the command
  std::string flight; ///< the original
  std::string folder; ///< for runs and copies, empty
};

/// What a process did, and whether that was right.
struct Seen
{
  bool is_right = false;
  std::string text;
};

struct Fault
{
  std::string group, name;
  std::string what; ///< goes on where the name ends
  Duty duty = Duty::survive;
  std::function<void(SpoiltFlight &)> spoil = {};
  std::string says = {};      ///< part of the line of a refusal, which stands in the table
  std::string arguments = {}; ///< of `bole track`
  std::function<Seen(const Shop &)> process = {};
  double since_s = kAt / kRate_hz; ///< begins then
};

/// \p fault as one that is there from the first frame on.
inline Fault fromTheFirst(Fault fault)
{
  fault.since_s = 0;
  return fault;
}

inline std::vector<Fault> joined(std::initializer_list<std::vector<Fault>> parts)
{
  std::vector<Fault> all;
  for (const std::vector<Fault> &part : parts)
    all.insert(all.end(), part.begin(), part.end());
  return all;
}

std::vector<Fault> pictureFaults();
std::vector<Fault> sensorFaults();
std::vector<Fault> fileFaults();
std::vector<Fault> processFaults();
} // namespace bole::faults
