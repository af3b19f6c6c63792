// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether what an image shows goes on across a border.
///
/// Idea: sills, plinths, joints and boards of a wall cross the borders of a strip of it; nothing goes on across an
/// occluding contour. So the changes of brightness along the border, just inside and just outside of it, are correlated
/// on a surface and not on a trunk. No depth is needed: one view tells, however little parallax there is.
///
/// Law (a test): 1 where both sides show the same rows, about 0 where they have nothing in common.

#include "gradient/border_line.h"

#include <optional>

namespace bole
{
/// Correlation of the changes of brightness along \p line on its two sides, each averaged over a strip of up to eight
/// pixels that begins off the border. \p half_width_px: of the trunk inside. None where the line is short or leaves the
/// image; 0 where nothing changes by more than a camera's noise.
std::optional<double> continuityAcross(const vpImage<unsigned char> &image, const BorderLine &line, Border border,
                                       double half_width_px);

/// The mean over the borders of a trunk, between the elevations \p part; none where neither tells.
std::optional<double> continuityOf(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                                   const RelativeTrunk &relative, const ElevationRange &part);
} // namespace bole
