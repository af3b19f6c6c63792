// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A frame as a level camera shows it that looks all round: what stands upright fills columns.
///
/// Idea: columns of equal bearing in the world, rows of equal tangent of elevation. A point at the horizontal range d
/// and the height h over the camera lies in row h/d, so a trunk is a run of columns, and the same piece of bark in two
/// frames differs by a column, by a factor d1/d2 of the rows and by a shift of them: matching is one-dimensional.

#include <bole/camera.h>
#include <bole/pose.h>

#include <cstdint>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// The grid of all level images of a flight.
struct LevelGrid
{
  double column_step = 0.005; ///< of bearing [rad]; a pixel
  double row_step = 0.015;    ///< of the tangent of elevation; about three pixels, over which a row is the mean
  double tan_low = -0.51;     ///< of the first row
  int rows = 68;

  double tanOf(double row) const { return tan_low + row * row_step; }
  double rowOf(double tan) const { return (tan - tan_low) / row_step; }
};

class LevelImage
{
public:
  LevelImage() = default;
  LevelImage(const vpImage<unsigned char> &image, const PinholeCamera &camera, const Pose &wMc, const LevelGrid &grid);

  /// The rows of a column that are in the image.
  struct Span
  {
    std::int16_t begin = 0, end = 0;
  };

  int columns() const { return static_cast<int>(m_spans.size()); }
  double bearingOf(double column) const { return (m_first + column) * m_grid.column_step; } ///< in the world [rad]
  /// Nearest way round; outside 0 .. columns() - 1 where the bearing is not in the image.
  double columnOf(double bearing) const;
  /// 0 to 255, one column after the other.
  const float *grey(int column) const { return &m_grey[static_cast<std::size_t>(column * m_grid.rows)]; }
  Span span(int column) const { return m_spans[static_cast<std::size_t>(column)]; }
  const Pose &wMc() const { return m_wMc; }
  const LevelGrid &grid() const { return m_grid; }

private:
  LevelGrid m_grid;
  Pose m_wMc;
  double m_first = 0; ///< bearing of column 0 in steps
  std::vector<float> m_grey;
  std::vector<Span> m_spans;
};
} // namespace bole
