// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What each frame cost, by stage.

#include <cstdint>
#include <string>
#include <vector>

namespace bole
{
struct FrameTiming
{
  std::size_t index = 0;
  std::int64_t stamp_ns = 0;
  std::vector<double> stages_ms; ///< in the order of TimingTable::stages
  double total_ms = 0;           ///< of the whole frame, without input and output
};

struct TimingTable
{
  std::vector<std::string> stages;
  std::vector<FrameTiming> frames;

  /// Median over the frames; 0 without frames.
  double medianTotal_ms() const;
  double medianStage_ms(std::size_t stage) const;
  /// The cost that 95 % of the frames stay below.
  double percentile95_ms() const;
};

/// Header "frame,timestamp [s],<stage> [ms],...,total [ms]", one line a frame, atomically.
void writeTiming(const std::string &path, const TimingTable &timing);
} // namespace bole
