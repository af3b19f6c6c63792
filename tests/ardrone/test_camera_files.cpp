// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/ardrone_source.h>

#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

using namespace bole;

TEST(ArDroneCamera, TheFilesEqualThePublishedValuesInTheCode)
{
  for (const int generation : {1, 2}) {
    const auto file =
        readCamera(std::string(BOLE_SOURCE_DIR) + "/config/cameras/ardrone" + std::to_string(generation) + ".yaml");
    const auto code = generation == 1 ? publishedArDroneCamera(1, 320, 240) : publishedArDroneCamera(2, 640, 360);
    EXPECT_EQ(file.model.pinhole.fx, code.model.pinhole.fx);
    EXPECT_EQ(file.model.pinhole.fy, code.model.pinhole.fy);
    EXPECT_EQ(file.model.pinhole.cx, code.model.pinhole.cx);
    EXPECT_EQ(file.model.pinhole.cy, code.model.pinhole.cy);
    EXPECT_EQ(file.model.distortion, code.model.distortion);
    EXPECT_EQ(file.model.coefficients, code.model.coefficients);
    EXPECT_LT((file.bMc.R - code.bMc.R).norm() + (file.bMc.t - code.bMc.t).norm(), 1e-12);
  }
}

TEST(ArDroneCamera, IsScaledToImagesOfItsShapeAndRefusedForOthers)
{
  const auto half = publishedArDroneCamera(2, 320, 180);
  EXPECT_NEAR(half.model.pinhole.fx, 284.95, 1e-9);
  EXPECT_EQ(half.model.pinhole.width, 320);
  EXPECT_THROW(publishedArDroneCamera(2, 640, 480), vpException);
}
