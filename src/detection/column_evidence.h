// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the images of a flight say of one trunk, by depth on both sides of its borders.
///
/// Idea: columns of the image that show a trunk look the same in two frames when they are carried over at the trunk's
/// range, and differ at any other; columns beside a silhouette belong to what stands behind it. So a hypothesis is
/// tried at its own range and at others, inside its borders and just outside of them, between frames whose parallax is
/// some pixels. No other hypothesis, no border and no learning is needed (stixels: Badino, Franke and Pfeiffer 2009;
/// occlusion borders: Stein and Hebert 2009).

#include "detection/level_image.h"
#include <bole/trunk.h>

#include <algorithm>
#include <array>
#include <optional>

namespace bole
{
/// A frame of the flight on the ground plane, at its final pose.
struct LevelView
{
  LevelView(const LevelImage &level, const Pose &wMc, double time_s = 0);

  const LevelImage *image;
  Eigen::Vector2d position, forward, left; ///< of the level camera in the world [m], [1], [1]
  double z;                                ///< its height in the world [m]
  double time_s;                           ///< stamp
};

/// Where a trunk stands in a view: bearing from the heading, half width, range.
struct TrunkInLevelView
{
  double bearing = 0, half_angle = 0, range = 0; ///< [rad], [rad], [m]
};
/// None behind the camera, beyond \p farthest [m] or cut by the side of the image.
std::optional<TrunkInLevelView> locate(const Trunk &trunk, const LevelView &view, double farthest);

/// Differences between frames of the columns of a trunk: means over its views of squared differences in units of the
/// contrast of the image, each cut at 4. 0: alike; 2 and more: nothing in common.
struct ColumnEvidence
{
  int views = 0;              ///< in which it was compared
  double own = 4;             ///< at its range
  double nearer = 0;          ///< best of the ranges nearer by a fifth and more, less own
  double beyond = 0;          ///< best of the ranges farther by a quarter and a half, less own
  double background = 0;      ///< best of those twice as far and farther, less own
  bool is_best_at_own = true; ///< among all ranges, its own to a ninth is best
  double left = 0, right = 0; ///< beside a border: at the trunk's range less the best farther one. Below 0: the trunk
                              ///< goes on there, and the border is one of light and shade
  double inside_left = 0, inside_right = 0; ///< the same of the outermost quarters inside. Above 0: the background
                                            ///< stands there, and the border is one of something behind

  double leastBeside() const { return std::min(left, right); }
  /// Of the border that is the least that of the silhouette: above 0 where the trunk stands inside, the background
  /// outside of both.
  double weakestBorder() const { return std::min({left, right, -inside_left, -inside_right}); }
};

/// Ranges that are tried, over that of the trunk.
constexpr std::size_t kTriedRanges = 11;

/// Means by range of what columns differ by, over the views of a trunk: inside it, beside its left border, beside its
/// right one, in the outermost quarters inside on the left and on the right.
struct ColumnCurves
{
  int views = 0;
  std::array<std::array<double, kTriedRanges>, 5> sum{}, count{};

  void add(std::size_t kind, std::size_t range, double value);
  void add(const ColumnCurves &view); ///< as one view
  /// What was added before counts by \p share of it.
  void fade(double share);
  double mean(std::size_t kind, std::size_t range) const;
  double least(std::size_t kind, std::size_t first, std::size_t end) const;
};

/// What \p views[which] says of \p trunk beside the others; none where it is not in sight or nothing has a parallax.
std::optional<ColumnCurves> columnsOfView(const Trunk &trunk, std::size_t which, const std::vector<LevelView> &views,
                                          double farthest);
/// None of fewer than three views.
std::optional<ColumnEvidence> evidenceOf(const ColumnCurves &curves);

/// None where fewer than three views have a parallax.
std::optional<ColumnEvidence> columnEvidence(const Trunk &trunk, const std::vector<LevelView> &views, double farthest);

/// Logarithm of the range at which the columns inside \p trunk differ least between its views, over that where it
/// stands. What they show is texture, which stands on the bark and turns away with it, and shade, which keeps to the
/// outline as if it stood in the plane of the axis: both are tried, and weighed by how well they fit (by texture alone
/// ranges come out 1.6 % too large). Error about .024 (rms, seeds 400 to 423). None where the least is not within a
/// quarter of its range, or fewer than three views have a parallax.
std::optional<double> rangeByColumns(const Trunk &trunk, const std::vector<LevelView> &views, double farthest);

/// Where a trunk ends by depth alone, left and right of its axis [m, outwards]: no light or shade moves it. From the
/// middle outwards the trunk explains the columns by less and less better than what stands behind it. None where
/// nothing behind is seen.
struct DepthBorders
{
  std::array<std::optional<double>, 2> least, likely; ///< as far as it surely goes on; the best guess
  double px = 0;                                      ///< a pixel at the range of the trunk [m]
};
/// None where the views are few or the trunk itself is not seen.
std::optional<DepthBorders> depthBorders(const Trunk &trunk, const std::vector<LevelView> &views, double farthest);
} // namespace bole
