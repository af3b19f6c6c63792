// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether a camera can be one, and calibrations of other programs in the terms of CameraModel.

#include <bole/open_source.h>

#include <string>

namespace bole
{
/// What cannot be true of a camera, and which of its parts says so.
struct Implausibility
{
  enum class Part
  {
    none,
    pinhole,
    distortion,
    mounting
  };
  Part part = Part::none;
  std::string text = {}; ///< with the limit
};

/// Looks at the size of the picture, field of view, shape of the pixels, principal point, whether the distortion folds
/// the picture, and the place in the body.
Implausibility implausibility(const MountedCamera &camera);
/// Throws for a camera that a program hands over and that cannot be one.
void requirePlausible(const MountedCamera &camera);

/// k1 and k2 that come closest to k1, k2, k3 over the picture of \p pinhole (OpenCV's calibrations have a third radial
/// coefficient, CameraModel two). \return the largest difference that is left [px].
double foldThirdCoefficient(const PinholeCamera &pinhole, double k3, double &k1, double &k2);
} // namespace bole
