// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What each frame cost, by stage.

#include <cstdint>
#include <optional>
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
  /// Live: from the arrival of the frame's last byte until the map knew of it.
  std::optional<double> age_ms;
};

struct TimingTable
{
  std::vector<std::string> stages;
  std::vector<FrameTiming> frames;

  /// Median over the frames; NaN without frames.
  double medianTotal_ms() const;
  double medianStage_ms(std::size_t stage) const;
  /// The cost that 95 % of the frames stay below.
  double percentile95_ms() const;
  /// The age of the frames that have one, below which a part \p quantile of them stays; nothing
  /// where none has.
  std::optional<double> age_ms(double quantile) const;
};

/// A line a stage, and one for the whole frame: median, 95th and 99th percentile, most.
std::string toText(const TimingTable &timing);

/// Header "frame,timestamp [s],<stage> [ms],...,total [ms]", and "age [ms]" for a live run; one line
/// a frame, atomically.
void writeTiming(const std::string &path, const TimingTable &timing);
} // namespace bole
