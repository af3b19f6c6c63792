// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Rectified column image: one frame reduced to the brightness of upright columns, by bearing.
///
/// Idea: turn the camera level, as for a LevelProfile, and average the image along each vertical plane through the
/// camera centre, in bands of elevation. A trunk fills a run of such columns with the same brightness in every band;
/// two frames are compared by a few numbers a column, and a whole flight is kept in some kilobytes a frame.

#include "detection/column_loops.h"
#include "gradient/border_line.h"

#include <vector>

namespace bole
{
struct ColumnImage
{
  Eigen::Matrix3d cRl = Eigen::Matrix3d::Identity(); ///< level frame (forward, left, up) to camera
  double q_first = 0; ///< tan of the bearing from the heading of column 0; columns run to the left
  double step = 0.005;
  double contrast = 0;                         ///< standard deviation of the brightness over the columns [full scale]
  std::array<double, kLevelBands> elevation{}; ///< tangent of the middle of each band
  std::array<std::vector<float>, kLevelBands> value, slope; ///< LevelColumn of each column, band by band

  std::size_t columns() const { return value[0].size(); }
  double qLast() const { return q_first + step * static_cast<double>(columns() - 1); }
  /// What stands at \p q at the height of the camera and leans by \p lean across the line of sight, positive to the
  /// left [tan]: at any range it shifts each band by its elevation. Linear between two columns.
  LevelColumn at(double q, double lean = 0) const;
};

/// Brightness of \p image seen by \p camera with the rotation \p wRc, in the elevations \p range. Columns are a pixel
/// wide, at most 1/300 of the heading's tangent fine. Cost: about 0.2 ms at 320x240.
ColumnImage computeColumnImage(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                               const Eigen::Matrix3d &wRc, const ElevationRange &range);
} // namespace bole
