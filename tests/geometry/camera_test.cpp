// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include <bole/camera.h>
#include <visp3/core/vpMeterPixelConversion.h>

namespace
{
using namespace bole;

const PinholeCamera kCamera{215.1, 215.8, 160.7, 123.3, 320, 240};

TEST(PinholeCamera, ProjectUndoesRay)
{
  for (const Eigen::Vector2d &u : {Eigen::Vector2d(0, 0), Eigen::Vector2d(319, 10), Eigen::Vector2d(77.25, 201.5)})
    EXPECT_LT((kCamera.project(3.7 * kCamera.ray(u)) - u).norm(), 1e-10);
}

TEST(PinholeCamera, ProjectsAsVispDoes)
{
  const Eigen::Vector3d p(0.4, -0.3, 2.5);
  double u = 0, v = 0;
  vpMeterPixelConversion::convertPoint(kCamera.toVisp(), p.x() / p.z(), p.y() / p.z(), u, v);
  EXPECT_LT((kCamera.project(p) - Eigen::Vector2d(u, v)).norm(), 1e-10);
}

TEST(PinholeCamera, ComesBackFromVisp)
{
  const PinholeCamera back = PinholeCamera::fromVisp(kCamera.toVisp(), 320, 240);
  EXPECT_DOUBLE_EQ(back.fx, kCamera.fx);
  EXPECT_DOUBLE_EQ(back.fy, kCamera.fy);
  EXPECT_DOUBLE_EQ(back.cx, kCamera.cx);
  EXPECT_DOUBLE_EQ(back.cy, kCamera.cy);
}

/// Pixel centres have whole coordinates: the image of 320 columns spans -0.5 to 319.5, and so does the scaled one.
TEST(PinholeCamera, ScalingKeepsTheCornersOfTheView)
{
  const PinholeCamera half = kCamera.scaled(0.5);
  EXPECT_EQ(half.width, 160);
  EXPECT_EQ(half.height, 120);
  EXPECT_LT((half.ray({-0.5, -0.5}) - kCamera.ray({-0.5, -0.5})).norm(), 1e-12);
  EXPECT_LT((half.ray({159.5, 119.5}) - kCamera.ray({319.5, 239.5})).norm(), 1e-12);
}

TEST(PinholeCamera, ContainsPixelsWithinTheMargin)
{
  EXPECT_TRUE(kCamera.contains({319, 0}));
  EXPECT_FALSE(kCamera.contains({319.01, 0}));
  EXPECT_TRUE(kCamera.contains({4, 4}, 4));
  EXPECT_FALSE(kCamera.contains({3.9, 100}, 4));
}

TEST(CameraModel, TheFovLensIsThatOfDevernayAndFaugeras)
{
  CameraModel model;
  model.distortion = Distortion::fov;
  model.coefficients = {{0.9, 0, 0, 0}};
  model.pinhole = kCamera;
  const Eigen::Vector2d xy(0.5, -0.2);
  const Eigen::Vector2d u = model.distort(xy);
  const Eigen::Vector2d bent((u.x() - kCamera.cx) / kCamera.fx, (u.y() - kCamera.cy) / kCamera.fy);
  // its inverse: r_u = tan(r_d s) / (2 tan(s / 2)), along the same direction
  EXPECT_NEAR(bent.x() * xy.y(), bent.y() * xy.x(), 1e-12);
  EXPECT_NEAR(std::tan(bent.norm() * 0.9) / (2 * std::tan(0.45)), xy.norm(), 1e-12);
  EXPECT_EQ(model.distort({0, 0}), Eigen::Vector2d(kCamera.cx, kCamera.cy)); // on the axis, where r is 0
  model.coefficients = {};                                                   // bends nothing
  EXPECT_LT((model.distort(xy) - kCamera.project({0.5, -0.2, 1})).norm(), 1e-12);
}

/// The pixels are those of cv2.projectPoints and cv2.fisheye.projectPoints (OpenCV 4.6) with the same numbers.
TEST(CameraModel, LensesOfBothKindsProjectAsThoseOfOpenCvDo)
{
  CameraModel model;
  model.pinhole = kCamera;
  model.distortion = Distortion::radial_tangential;
  model.coefficients = {{-0.28, 0.07, 0.0012, -0.0021}};
  EXPECT_LT((model.distort({0.5, -0.2}) - Eigen::Vector2d(259.74161195, 83.57696028)).norm(), 1e-7);
  model.distortion = Distortion::equidistant;
  model.coefficients = {{-0.02, 0.013, -0.007, 0.004}};
  EXPECT_LT((model.distort({0.5, -0.2}) - Eigen::Vector2d(258.9424249, 83.8751459)).norm(), 1e-6);
  EXPECT_EQ(model.distort({0, 0}), Eigen::Vector2d(kCamera.cx, kCamera.cy)); // on the axis, where r is 0
}
} // namespace
