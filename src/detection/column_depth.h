// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How well each column of a frame agrees with the frames beside it, at each range.
///
/// Idea: forests have too little texture for windows of pixels, but what stands upright repeats itself over a whole
/// column. So whole columns are matched, part by part of their height, against a frame before and a frame after: what
/// one of the two cannot see, the other often can.

#include "detection/level_image.h"

namespace bole
{
struct DepthSweep
{
  int steps = 40;              ///< of the inverse range from 0 on
  double inverse_step = 0.018; ///< [1/m]
  int bands = 6;               ///< equal parts of the height of the level image

  double inverseOf(double step) const { return inverse_step * step; }
  double stepOf(double range) const { return 1 / (range * inverse_step); }
};

class ColumnDepth
{
public:
  ColumnDepth() = default;
  /// \p beside: frames from other places, one or more.
  ColumnDepth(const LevelImage &frame, const std::vector<const LevelImage *> &beside, const DepthSweep &sweep);

  /// Mean difference of the column at the range of a step, 0 (alike) to 1, over the rows between two tangents of
  /// elevation; negative where it was not seen.
  double cost(int column, int step, double tan_low, double tan_high) const;

private:
  void match(const LevelImage &frame, const LevelImage &other);

  DepthSweep m_sweep;
  LevelGrid m_grid;
  int m_columns = 0;
  std::vector<std::uint8_t> m_cost; ///< by column, step, band
};
} // namespace bole
