// SPDX-License-Identifier: GPL-2.0-or-later
// V of Eq. 14.
#include "paper/rotation_em.h"
#include "support/units.h"

#include <gtest/gtest.h>
#include <visp3/visual_features/vpFeaturePoint.h>

namespace
{
using namespace bole;
using bole::paper::flowMatrix;
using bole::paper::FlowMatrix;

const PinholeCamera kCamera{215.1, 215.1, 160.7, 123.3, 320, 240};

TEST(FlowMatrix, IsFTimesTheInteractionMatrixOfViSP)
{
  for (const Eigen::Vector2d &u : {Eigen::Vector2d(0, 0), Eigen::Vector2d(310, 20), Eigen::Vector2d(160.7, 123.3)}) {
    const Eigen::Vector3d ray = kCamera.ray(u);
    vpFeaturePoint point;
    point.buildFrom(ray.x(), ray.y(), 3.5);
    const vpMatrix L = point.interaction();
    const FlowMatrix V = flowMatrix(kCamera, u);
    for (unsigned i = 0; i < 2; ++i)
      for (unsigned j = 0; j < 3; ++j)
        EXPECT_NEAR(V(i, j), kCamera.fx * L[i][3 + j], 1e-9);
  }
}

TEST(FlowMatrix, IsTheDerivativeOfTheWarpWithTheSignTurned)
{
  const Eigen::Vector2d u(250, 60);
  double last_error = 0;
  for (const double h : {2e-3, 1e-3}) {
    FlowMatrix V;
    for (int k = 0; k < 3; ++k) {
      const auto before = [&](double turn) {
        return kCamera.project(expSo3(turn * Eigen::Vector3d::Unit(k)) * kCamera.ray(u));
      };
      V.col(k) = -(before(h) - before(-h)) / (2 * h);
    }
    const double error = (V - flowMatrix(kCamera, u)).norm();
    EXPECT_LT(error, 1e-2);
    if (last_error > 0) {
      EXPECT_NEAR(last_error / error, 4, 0.4);
    }
    last_error = error;
  }
}
} // namespace
