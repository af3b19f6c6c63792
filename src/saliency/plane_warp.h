// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: where pixels come from, row by row, and bilinear samples there.

#include <bole/camera.h>
#include <bole/pose.h>

#include <Eigen/LU>
#include <visp3/core/vpImage.h>

namespace bole
{
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

/// Weights of a bilinear sample; `inside` is false where one of the four pixels is missing.
struct Bilinear
{
  int i = 0, j = 0;
  float a = 0, b = 0;
  bool inside = false;

  Bilinear(float x, float y, int width, int height)
  {
    inside = x >= 0 && y >= 0 && x < width - 1 && y < height - 1; // false for NaN
    if (!inside)
      return;
    j = static_cast<int>(x);
    i = static_cast<int>(y);
    a = x - j;
    b = y - i;
  }
  float operator()(const vpImage<float> &image) const
  {
    const float *p = image.bitmap + static_cast<std::size_t>(i) * image.getWidth() + j;
    const float *q = p + image.getWidth();
    const float upper = p[0] + a * (p[1] - p[0]), lower = q[0] + a * (q[1] - q[0]);
    return upper + b * (lower - upper);
  }
};
} // namespace bole
