// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/flow_matrix.h"

namespace bole
{
FlowMatrix flowMatrix(const PinholeCamera &camera, const Eigen::Vector2d &u_px)
{
  const Eigen::Vector3d ray = camera.ray(u_px);
  const double x = ray.x(), y = ray.y();
  FlowMatrix V;
  V << camera.fx * x * y, -camera.fx * (1 + x * x), camera.fx * y, // Eq. 14
      camera.fy * (1 + y * y), -camera.fy * x * y, -camera.fy * x;
  return V;
}

FlowMatrix translationFlowMatrix(const PinholeCamera &camera, const Eigen::Vector2d &u_px)
{
  const Eigen::Vector3d ray = camera.ray(u_px);
  FlowMatrix A;
  A << -camera.fx, 0, camera.fx * ray.x(), 0, -camera.fy, camera.fy * ray.y();
  return A;
}
} // namespace bole
