// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What an image says across the border of a cylinder of any direction.
///
/// Idea: the energy that holds in textured forest is the absolute value of the *mean of the signed*
/// gradient along the border (bark and leaves cancel in the sum). The derivative of a mean is the mean of
/// the derivative: so the image is averaged along the border first, at each offset across it, and only the
/// 1-D profile is differentiated. One look-up a sample and offset gives the energy at every offset of
/// the scan, without a gradient image, for a border of any direction.
///
/// Offsets are in pixels along the outward normal of the border (out of the trunk). Signed contrast: positive
/// where the background is brighter than the trunk.

#include "geometry/cylinder.h"
#include <bole/camera.h>

#include <optional>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// The part of a cylinder's border that the image shows, as a straight line in pixels.
struct VisibleBorder
{
  Border side = Border::left;
  Eigen::Vector2d foot_px = Eigen::Vector2d::Zero(), top_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX(); ///< unit, pixels, out of the trunk

  double length() const { return (top_px - foot_px).norm(); } ///< [px]
  Eigen::Vector2d at(double t) const { return foot_px + t * (top_px - foot_px); }
};

/// The border \p side of the cylinder \p c (camera frame), cut at its ends, at \p near_m in front of the camera
/// and at \p margin_px inside the image; nullopt where nothing of it is left.
std::optional<VisibleBorder> visibleBorder(const PinholeCamera &camera, const Cylinder &c,
                                           const RelativeTrunk &relative, Border side, double near_m, double margin_px);

/// Mean grey level at each offset -half .. half (step 1 px) along pieces of a border.
struct BorderProfile
{
  int half = 0;
  int pieces = 0;
  std::vector<float> mean;    ///< pieces x (2 half + 1), piece after piece from foot to top
  std::vector<float> visible; ///< share of each piece that was sampled, 0 .. 1
  std::vector<double> centre; ///< place of each piece on the border, 0 foot .. 1 top

  int width() const { return 2 * half + 1; }
  /// Signed contrast (derivative of the profile blurred with sigma 1 px, grey levels a pixel) of piece
  /// \p piece, or of the whole border for -1, at every offset; zero in the two outermost.
  std::vector<float> contrast(int piece) const;
  /// Mean grey level of the whole border.
  std::vector<float> whole() const;
};

/// Samples \p image across \p border: \p samples places along it in \p pieces pieces. \p hidden[k] tells that
/// sample k is hidden (empty: none is). Offsets that leave the image repeat its edge.
BorderProfile sampleBorder(const vpImage<unsigned char> &image, const VisibleBorder &border, int half, int samples,
                           int pieces, const std::vector<bool> &hidden);

/// A local maximum of the absolute contrast.
struct ContrastPeak
{
  double offset_px = 0; ///< refined by a parabola
  double contrast = 0;  ///< signed, grey levels a pixel
};
std::vector<ContrastPeak> contrastPeaks(const std::vector<float> &contrast);
} // namespace bole
