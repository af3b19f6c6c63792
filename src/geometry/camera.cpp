// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/camera.h>

#include "geometry/names.h"

#include <cmath>

namespace bole
{
const char *toString(Distortion distortion)
{
  return nameOf(distortion, {"none", "radial-tangential", "equidistant", "fov"});
}

PinholeCamera PinholeCamera::scaled(double factor) const
{
  PinholeCamera camera = *this;
  camera.fx *= factor;
  camera.fy *= factor;
  camera.cx = (cx + 0.5) * factor - 0.5;
  camera.cy = (cy + 0.5) * factor - 0.5;
  camera.width = static_cast<int>(std::lround(width * factor));
  camera.height = static_cast<int>(std::lround(height * factor));
  return camera;
}

PinholeCamera PinholeCamera::fromVisp(const vpCameraParameters &cam, int width, int height)
{
  return {cam.get_px(), cam.get_py(), cam.get_u0(), cam.get_v0(), width, height};
}

Eigen::Vector2d CameraModel::distort(const Eigen::Vector2d &xy) const
{
  const auto &k = coefficients;
  const double r2 = xy.squaredNorm();
  const double r = std::sqrt(r2);
  Eigen::Vector2d bent = xy;
  switch (distortion) {
  case Distortion::none:
    break;
  case Distortion::radial_tangential: {
    const double x = xy.x(), y = xy.y();
    const double radial = 1 + r2 * (k[0] + r2 * k[1]);
    bent = {x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
            y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y};
    break;
  }
  case Distortion::equidistant: {
    if (r < 1e-12)
      break;
    const double a = std::atan(r), a2 = a * a;
    bent *= a * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])))) / r;
    break;
  }
  case Distortion::fov:
    if (r > 1e-12 && std::abs(k[0]) > 1e-9)
      bent *= std::atan(2 * r * std::tan(0.5 * k[0])) / (k[0] * r);
    break;
  }
  return {pinhole.fx * bent.x() + pinhole.cx, pinhole.fy * bent.y() + pinhole.cy};
}
} // namespace bole
