// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include "saliency/flow_matrix.h"
#include <bole/pose.h>

#include <gtest/gtest.h>
#include <visp3/visual_features/vpFeaturePoint.h>

namespace bole
{
namespace
{
const PinholeCamera kCamera{215.1, 215.1, 160.7, 123.3, 320, 240};

TEST(FlowMatrix, IsFTimesTheInteractionMatrixOfViSP)
{
  for (const Eigen::Vector2d &u : {Eigen::Vector2d(0, 0), Eigen::Vector2d(310, 20), Eigen::Vector2d(160.7, 123.3)}) {
    const Eigen::Vector3d ray = kCamera.ray(u);
    const double Z = 3.5;
    vpFeaturePoint point;
    point.buildFrom(ray.x(), ray.y(), Z);
    const vpMatrix L = point.interaction();
    const FlowMatrix V = flowMatrix(kCamera, u), A = translationFlowMatrix(kCamera, u);
    for (unsigned i = 0; i < 2; ++i)
      for (unsigned j = 0; j < 3; ++j) {
        EXPECT_NEAR(V(i, j), kCamera.fx * L[i][3 + j], 1e-9);
        EXPECT_NEAR(A(i, j) / Z, kCamera.fx * L[i][j], 1e-9);
      }
  }
}

TEST(FlowMatrix, IsEquation14InPixelsFromTheCentre)
{
  const double f = kCamera.fx, x = 40, y = -25;
  const FlowMatrix V = flowMatrix(kCamera, {kCamera.cx + x, kCamera.cy + y});
  FlowMatrix printed;
  printed << x * y, -f * f - x * x, f * y, f * f + y * y, -x * y, -f * x;
  EXPECT_LT((V - printed / f).norm(), 1e-9);
}

/// Where the point that is now at pixel \p u with inverse depth \p rho was in the image of the camera p.
Eigen::Vector2d previousPixel(const Pose &pMc, const Eigen::Vector2d &u, double rho)
{
  return kCamera.project(pMc.R * kCamera.ray(u) + rho * pMc.t);
}

TEST(FlowMatrix, IsTheDerivativeOfTheWarpWithTheSignTurned)
{
  const Eigen::Vector2d u(250, 60);
  const double rho = 0.4;
  double last_error = 0;
  for (const double h : {2e-3, 1e-3}) {
    FlowMatrix V, A;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d d = h * Eigen::Vector3d::Unit(k);
      const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
      V.col(k) =
          -(previousPixel(Pose(expSo3(d), {0, 0, 0}), u, rho) - previousPixel(Pose(expSo3(-d), {0, 0, 0}), u, rho)) /
          (2 * h);
      A.col(k) = -(previousPixel(Pose(I, d), u, rho) - previousPixel(Pose(I, -d), u, rho)) / (2 * h);
    }
    const double error = (V - flowMatrix(kCamera, u)).norm() + (A - rho * translationFlowMatrix(kCamera, u)).norm();
    EXPECT_LT(error, 1e-2);
    if (last_error > 0) {
      EXPECT_NEAR(last_error / error, 4, 0.4);
    }
    last_error = error;
  }
}
} // namespace
} // namespace bole
