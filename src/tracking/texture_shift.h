// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far the texture of a trunk moved from one image to the next beyond its prediction.
///
/// Idea: borders may be taken for lines of light and shade or of what stands behind, and a border that slips does so
/// frame by frame. What lies between them moves with the trunk and with nothing else: the pixels that surely show bark
/// are carried from one image to the other by the poses and the cylinder, and the shift that is left is the one under
/// which the two agree best. Least squares over whole shifts, refined by a quadratic.
///
/// Laws (each a test): in a pair of images without noise the shift of a textured cylinder is found to 0.25 px; a
/// uniform or periodic bark has none, nor have half a trunk and half of what stands behind it.

#include "gradient/border_line.h"
#include <bole/trunk.h>

#include <optional>
#include <visp3/core/vpImage.h>

namespace bole
{
/// An image and where the camera stood, or is expected to stand.
struct TextureView
{
  const vpImage<unsigned char> &image;
  Pose wMc;
};

struct TextureShift
{
  double angle = 0;    ///< of the trunk about its axis' direction beside where it was expected, to the left [rad]
  double variance = 0; ///< [rad^2]
};

/// \p part: tangents of elevation between which the trunk is looked at. \p search_px: largest shift that is looked for
/// across the trunk, 1 to 30. None where the trunk is narrow in the image, or its bark shows too little or repeats
/// itself.
std::optional<TextureShift> textureShift(const TextureView &before, const TextureView &now, const PinholeCamera &camera,
                                         const Trunk &trunk, const ElevationRange &part, double search_px);
} // namespace bole
