// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// An image at several sizes, with its gradient, for the search from coarse to fine, and where its pixels come from.

#include <bole/camera.h>
#include <bole/pose.h>

#include <Eigen/LU>
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

/// Homogeneous pixel of the previous image: H u + rho e, H = K pRc K^-1, e = K pt.
struct PlaneWarp
{
  Eigen::Matrix3f H;
  Eigen::Vector3f e;

  PlaneWarp(const PinholeCamera &camera, const Pose &pMc)
  {
    Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
    K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
    H = (K * pMc.R * K.inverse()).cast<float>();
    e = (K * pMc.t).cast<float>();
  }
};
} // namespace bole
