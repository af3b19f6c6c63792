// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One border of a trunk as a line in the image, and the mean gradient along it.

#include <bole/camera.h>
#include <bole/trunk.h>

#include <array>
#include <visp3/core/vpImage.h>

namespace bole
{
/// The image line x(v) = x_top + slope * (v - row_begin) on the rows [row_begin, row_end).
struct BorderLine
{
  double x_top = 0; ///< [px]
  double slope = 0; ///< [px/row]
  int row_begin = 0, row_end = 0;

  double xAt(double v) const { return x_top + slope * (v - row_begin); }
  int rows() const { return row_end > row_begin ? row_end - row_begin : 0; }
  /// The same line moved to the right by \p top at its first row and by \p bottom at its last.
  BorderLine moved(double top, double bottom) const;
};

/// Both borders of a trunk, to go over.
inline constexpr std::array<Border, 2> kBorders{Border::left, Border::right};

/// Part of a border that may be seen: tangents of the elevation above the horizontal plane of the camera.
struct ElevationRange
{
  double low = -0.17; ///< the foot of a trunk 7 m away under a camera at 1.2 m
  double high = 0.45; ///< below the crowns
};

/// Columns per row of the most inclined line that is sampled row by row, 72 degrees: a sample then reaches over three
/// columns, and a drone banks less while it flies.
constexpr double kMostSlope = 3;

/// Rows and line of the plane through the camera centre with normal \p cn between the two directions
/// \p low and \p high of that plane (camera frame), clipped to the image less \p margin_px columns.
/// No rows when the line is not in the image or has more than \p most_slope columns per row.
BorderLine clippedLine(const PinholeCamera &camera, const Eigen::Vector3d &cn, const Eigen::Vector3d &low,
                       const Eigen::Vector3d &high, double margin_px = 4, double most_slope = kMostSlope);

/// The line of one border of a relative trunk.
BorderLine borderLine(const PinholeCamera &camera, const RelativeTrunk &relative, Border border,
                      const ElevationRange &range);

/// Jacobian (2x4) of the horizontal displacements [px] of the first and last row of \p line by the tangent
/// of the relative trunk: what MeanGradient is differentiated by, carried to theta^r.
Eigen::Matrix<double, 2, 4> borderJacobian(const PinholeCamera &camera, const RelativeTrunk &relative, Border border,
                                           const BorderLine &line);

/// Mean of an image along a line, one sample a row, cubic between columns, and its derivatives by the
/// horizontal displacement of the first and last row. Samples outside the image count as zero.
struct MeanGradient
{
  double mean = 0;
  double by_top = 0, by_bottom = 0; ///< [1/px]
};
MeanGradient meanAlong(const vpImage<float> &g, const BorderLine &line);

/// Only the mean, linear between columns, for scans: about 0.15 us for 100 rows.
double meanAlongOnly(const vpImage<float> &g, const BorderLine &line);

/// How evenly a border of the \p sign runs along the whole line: the squared mean of eight parts over their mean
/// square, each part at its strongest within a pixel. 1: all parts alike, as on the silhouette of a trunk; 1/8: one
/// part alone, as on a branch that crosses; 0: the parts are against the sign.
double evennessAlong(const vpImage<float> &g, const BorderLine &line, double sign);
} // namespace bole
