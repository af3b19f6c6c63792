// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// An image at several sizes, with its gradient, for the search from coarse to fine.

#include <bole/camera.h>

#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
struct PyramidLevel
{
  PinholeCamera camera;
  vpImage<float> image;                  ///< 1 = full scale
  vpImage<float> gradient_x, gradient_y; ///< central differences [1/px of this level]
};

/// Level k is 2^k times smaller; each pixel is the mean of four of the level below. A level is never smaller than
/// 16 pixels, so that there may be fewer levels than asked for. Gradients are made from \p finest_level on; the image
/// of level 0 is empty where \p finest_level is above.
class ImagePyramid
{
public:
  ImagePyramid() = default;
  ImagePyramid(const vpImage<unsigned char> &image, const PinholeCamera &camera, int levels, int finest_level = 0);

  int levels() const { return static_cast<int>(m_levels.size()); }
  const PyramidLevel &operator[](int level) const { return m_levels[static_cast<std::size_t>(level)]; }
  bool empty() const { return m_levels.empty(); }

private:
  std::vector<PyramidLevel> m_levels;
};
} // namespace bole
